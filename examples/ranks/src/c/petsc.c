/* What is called of PETSc: conjugate gradients with algebraic multigrid by smoothed aggregation, for symmetric definite
 * matrices of solids. Its objects stay on this side. An error of PETSc itself, which one rank may have alone, ends all
 * ranks; that iterations do not converge is no such error, and known to all. */

#include <petscksp.h>
#include <string.h>

struct multigrid {
    Mat matrix;
    Vec rhs, solution;
    KSP iteration;
};

int shim_petsc_init(void) {
    PetscOptionsSetValue(NULL, "-no_signal_handler", NULL);
    PetscCall(PetscInitializeNoArguments());
    PetscCall(PetscPushErrorHandler(PetscMPIAbortErrorHandler, NULL));
    return 0;
}

int shim_petsc_finalize(void) { return PetscFinalize(); }

void shim_petsc_free(void *handle) {
    struct multigrid *grid = handle;
    KSPDestroy(&grid->iteration);
    VecDestroy(&grid->rhs);
    VecDestroy(&grid->solution);
    MatDestroy(&grid->matrix);
    free(grid);
}

/* A matrix of which this rank has `own` consecutive rows, those of its nodes, three each, with their coordinates. The
 * lists are changed. */
int shim_petsc_new(void **handle, int own, const double *coordinates, long entries, int *rows, int *columns,
                   double tolerance, int most) {
    struct multigrid *grid = calloc(1, sizeof *grid);
    *handle = grid;
    if (!grid) {
        return PETSC_ERR_MEM;
    }
    PetscCall(MatCreate(PETSC_COMM_WORLD, &grid->matrix));
    PetscCall(MatSetSizes(grid->matrix, own, own, PETSC_DETERMINE, PETSC_DETERMINE));
    PetscCall(MatSetType(grid->matrix, MATAIJ));
    PetscCall(MatSetBlockSize(grid->matrix, 3));
    PetscCall(MatSetPreallocationCOO(grid->matrix, entries, rows, columns));
    PetscCall(MatSetOption(grid->matrix, MAT_SPD, PETSC_TRUE));
    PetscCall(MatCreateVecs(grid->matrix, &grid->solution, &grid->rhs));

    /* Rigid motions are what the coarse grids have to know. */
    Vec places;
    MatNullSpace rigid;
    PetscScalar *values;
    PetscCall(VecDuplicate(grid->rhs, &places));
    PetscCall(VecSetBlockSize(places, 3));
    PetscCall(VecGetArrayWrite(places, &values));
    memcpy(values, coordinates, (size_t)own * sizeof *values);
    PetscCall(VecRestoreArrayWrite(places, &values));
    PetscCall(MatNullSpaceCreateRigidBody(places, &rigid));
    PetscCall(MatSetNearNullSpace(grid->matrix, rigid));
    PetscCall(MatNullSpaceDestroy(&rigid));
    PetscCall(VecDestroy(&places));

    PC multigrid;
    PetscCall(KSPCreate(PETSC_COMM_WORLD, &grid->iteration));
    PetscCall(KSPSetType(grid->iteration, KSPCG));
    PetscCall(KSPSetNormType(grid->iteration, KSP_NORM_UNPRECONDITIONED));
    PetscCall(KSPSetTolerances(grid->iteration, tolerance, 0.0, 1e10, most));
    PetscCall(KSPGetPC(grid->iteration, &multigrid));
    PetscCall(PCSetType(multigrid, PCGAMG));
    /* Another matrix of the same body has the same aggregates. */
    PetscCall(PCGAMGSetReuseInterpolation(multigrid, PETSC_TRUE));
    /* Coarser grids than this are not worth their messages. */
    PetscCall(PCGAMGSetCoarseEqLim(multigrid, 200));
    PetscCall(KSPSetFromOptions(grid->iteration));
    return 0;
}

/* Whether the preconditioner could be built is in `reason`: negative if not, the same on all ranks. */
int shim_petsc_factorize(void *handle, const double *values, int *reason) {
    struct multigrid *grid = handle;
    PetscCall(MatSetValuesCOO(grid->matrix, values, INSERT_VALUES));
    PetscCall(KSPSetOperators(grid->iteration, grid->matrix, grid->matrix));
    PetscCall(KSPSetUp(grid->iteration));
    PC multigrid;
    PCFailedReason failed;
    PetscCall(KSPGetPC(grid->iteration, &multigrid));
    PetscCall(PCGetFailedReason(multigrid, &failed));
    *reason = failed == PC_NOERROR ? 0 : KSP_DIVERGED_PC_FAILED;
    return 0;
}

/* `x` is the right-hand side of the rows of this rank, and then the solution. `residual` is relative. */
int shim_petsc_solve(void *handle, double *x, int own, int *iterations, int *reason, double *residual) {
    struct multigrid *grid = handle;
    PetscScalar *values;
    PetscReal norm, rest;
    PetscCall(VecGetArrayWrite(grid->rhs, &values));
    memcpy(values, x, (size_t)own * sizeof *values);
    PetscCall(VecRestoreArrayWrite(grid->rhs, &values));
    PetscCall(KSPSolve(grid->iteration, grid->rhs, grid->solution));
    const PetscScalar *solution;
    PetscCall(VecGetArrayRead(grid->solution, &solution));
    memcpy(x, solution, (size_t)own * sizeof *x);
    PetscCall(VecRestoreArrayRead(grid->solution, &solution));
    KSPConvergedReason why;
    PetscCall(KSPGetConvergedReason(grid->iteration, &why));
    PetscCall(KSPGetIterationNumber(grid->iteration, iterations));
    PetscCall(KSPGetResidualNorm(grid->iteration, &rest));
    PetscCall(VecNorm(grid->rhs, NORM_2, &norm));
    *reason = why;
    *residual = norm > 0.0 ? rest / norm : rest;
    return 0;
}

/* Entries of the matrices of all grids, over those of the finest one. */
int shim_petsc_complexity(void *handle, double *operators) {
    struct multigrid *grid = handle;
    PC multigrid;
    PetscReal grids, all;
    PetscCall(KSPGetPC(grid->iteration, &multigrid));
    PetscCall(PCMGGetGridComplexity(multigrid, &grids, &all));
    *operators = all;
    return 0;
}
