/* What is called of MUMPS: its structure stays on this side. Its errors are INFOG(1), the same on all ranks, and INFOG(2)
 * says more. */

#include <dmumps_c.h>
#include <mpi.h>
#include <stdlib.h>
#include <string.h>

#define ICNTL(k) icntl[(k) - 1]
#define INFOG(k) infog[(k) - 1]

static int call(DMUMPS_STRUC_C *mumps, int job) {
    mumps->job = job;
    dmumps_c(mumps);
    return mumps->INFOG(1) < 0 ? mumps->INFOG(1) : 0;
}

int shim_mumps_new(void **handle) {
    DMUMPS_STRUC_C *mumps = calloc(1, sizeof *mumps);
    *handle = mumps;
    if (!mumps) {
        return -13;
    }
    mumps->par = 1;
    mumps->sym = 2;
    mumps->comm_fortran = MPI_Comm_c2f(MPI_COMM_WORLD);
    int error = call(mumps, -1);
    mumps->ICNTL(1) = mumps->ICNTL(2) = mumps->ICNTL(3) = -1;
    mumps->ICNTL(4) = 0;
    mumps->ICNTL(10) = 0; /* no iterative refinement */
    mumps->ICNTL(13) = 1; /* the root of the tree on one rank: its inertia is counted */
    mumps->ICNTL(14) = 40;
    return error;
}

void shim_mumps_free(void *handle) {
    DMUMPS_STRUC_C *mumps = handle;
    call(mumps, -2);
    free(mumps->schur);
    free(mumps);
}

/* The entries are those of this rank if `distributed`, else all of them, on the root. The arrays have to live on. */
int shim_mumps_analyze(void *handle, int dofs, long entries, int *rows, int *columns, int distributed, int *last,
                       int last_count) {
    DMUMPS_STRUC_C *mumps = handle;
    mumps->n = dofs;
    mumps->ICNTL(18) = distributed ? 3 : 0;
    if (distributed) {
        mumps->nnz_loc = entries;
        mumps->irn_loc = rows;
        mumps->jcn_loc = columns;
    } else {
        mumps->nnz = entries;
        mumps->irn = rows;
        mumps->jcn = columns;
    }
    if (last_count > 0) {
        mumps->ICNTL(19) = 1; /* the Schur complement, whole, on the root */
        mumps->size_schur = last_count;
        mumps->listvar_schur = last;
        mumps->schur = malloc((size_t)last_count * (size_t)last_count * sizeof(double));
        if (!mumps->schur) {
            return -13;
        }
    }
    return call(mumps, 1);
}

int shim_mumps_factorize(void *handle, double *values, int distributed) {
    DMUMPS_STRUC_C *mumps = handle;
    if (distributed) {
        mumps->a_loc = values;
    } else {
        mumps->a = values;
    }
    return call(mumps, 2);
}

/* What the analysis estimates, or the factorization has found: entries of the factors, in millions if negative. */
int shim_mumps_stored(void *handle, int factorized) {
    DMUMPS_STRUC_C *mumps = handle;
    return mumps->INFOG(factorized ? 29 : 20);
}

void shim_mumps_limit(void *handle, int megabytes) { ((DMUMPS_STRUC_C *)handle)->ICNTL(23) = megabytes; }

int shim_mumps_negative_pivots(void *handle) { return ((DMUMPS_STRUC_C *)handle)->INFOG(12); }

int shim_mumps_detail(void *handle) { return ((DMUMPS_STRUC_C *)handle)->INFOG(2); }

/* The lower triangle of the Schur complement by rows, on the root. */
void shim_mumps_schur(void *handle, double *out) {
    DMUMPS_STRUC_C *mumps = handle;
    memcpy(out, mumps->schur, (size_t)mumps->size_schur * (size_t)mumps->size_schur * sizeof(double));
}

/* Right-hand sides and solutions are whole, on the root. part 0: all; 1: eliminate the interior, `reduced` is what is
 * left on the interface; 2: complete the solution from that of the interface. */
int shim_mumps_solve(void *handle, double *rhs, int dofs, int columns, int part, double *reduced, int last_count) {
    DMUMPS_STRUC_C *mumps = handle;
    mumps->ICNTL(20) = mumps->ICNTL(21) = 0;
    mumps->rhs = rhs;
    mumps->nrhs = columns;
    mumps->lrhs = dofs;
    mumps->ICNTL(26) = part;
    mumps->redrhs = reduced;
    mumps->lredrhs = last_count;
    return call(mumps, 3);
}

/* How many entries of a solution this rank gets where solutions are left where they are computed. */
int shim_mumps_solved_here(void *handle) { return ((DMUMPS_STRUC_C *)handle)->info[22]; }

/* The same with right-hand sides and solutions over the ranks: each gives the rows that it has, and gets the entries of
 * the pivots that it has eliminated, whose numbers are in `solved`. Part 2 has no right-hand side but that of the
 * interface; MUMPS 5.5 ends by a fault of memory if told that it is distributed, so it gets `rhs` as a whole one. */
int shim_mumps_solve_distributed(void *handle, int columns, int given_count, int *given, double *rhs, int dofs,
                                 int solved_count, int *solved, double *solution, int part, double *reduced,
                                 int last_count) {
    DMUMPS_STRUC_C *mumps = handle;
    int rank;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    /* (A whole right-hand side is the root's alone.) */
    mumps->rhs = part == 2 && rank == 0 ? rhs : NULL;
    mumps->lrhs = dofs;
    mumps->ICNTL(20) = part == 2 ? 0 : 10;
    mumps->ICNTL(21) = 1;
    mumps->nrhs = columns;
    mumps->nloc_rhs = mumps->lrhs_loc = given_count;
    mumps->irhs_loc = given;
    mumps->rhs_loc = rhs;
    mumps->lsol_loc = solved_count;
    mumps->isol_loc = solved;
    mumps->sol_loc = solution;
    mumps->ICNTL(26) = part;
    mumps->redrhs = reduced;
    mumps->lredrhs = last_count;
    return call(mumps, 3);
}
