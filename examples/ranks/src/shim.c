/* What is called of MPI and MUMPS, with plain numbers and pointers only: the handles of MPI and the structure of MUMPS
 * are other types in each implementation, and stay on this side. All functions return 0, or an error of MPI or MUMPS. */

#include <dmumps_c.h>
#include <mpi.h>
#include <stdlib.h>
#include <string.h>

int shim_init(int *rank, int *size) {
    int provided;
    int error = MPI_Init_thread(NULL, NULL, MPI_THREAD_FUNNELED, &provided);
    if (error == MPI_SUCCESS) {
        MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
        MPI_Comm_rank(MPI_COMM_WORLD, rank);
        MPI_Comm_size(MPI_COMM_WORLD, size);
    }
    return error;
}

int shim_finalize(void) { return MPI_Finalize(); }

void shim_abort(int code) { MPI_Abort(MPI_COMM_WORLD, code); }

/* To the root and back, so that all ranks have the same bits. */
int shim_reduce(double *values, int count, int largest) {
    MPI_Op op = largest ? MPI_MAX : MPI_SUM;
    int rank;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    void *send = rank == 0 ? MPI_IN_PLACE : values;
    int error = MPI_Reduce(send, values, count, MPI_DOUBLE, op, 0, MPI_COMM_WORLD);
    return error != MPI_SUCCESS ? error : MPI_Bcast(values, count, MPI_DOUBLE, 0, MPI_COMM_WORLD);
}

int shim_broadcast(double *values, int count) { return MPI_Bcast(values, count, MPI_DOUBLE, 0, MPI_COMM_WORLD); }

int shim_gather_count(int own, int *counts) {
    return MPI_Allgather(&own, 1, MPI_INT, counts, 1, MPI_INT, MPI_COMM_WORLD);
}

int shim_gather_ints(const int *own, int count, int *all, const int *counts, const int *starts) {
    return MPI_Allgatherv(own, count, MPI_INT, all, counts, starts, MPI_INT, MPI_COMM_WORLD);
}

int shim_gather_to_root(const double *own, int count, double *all, const int *counts, const int *starts) {
    return MPI_Gatherv(own, count, MPI_DOUBLE, all, counts, starts, MPI_DOUBLE, 0, MPI_COMM_WORLD);
}

int shim_scatter_from_root(const double *all, const int *counts, const int *starts, double *own, int count) {
    return MPI_Scatterv(all, counts, starts, MPI_DOUBLE, own, count, MPI_DOUBLE, 0, MPI_COMM_WORLD);
}

/* Sends to and receives from some ranks; the numbers of each follow one another. */
int shim_exchange(int peers, const int *ranks, const int *send_counts, const double *send, const int *receive_counts,
                  double *receive) {
    MPI_Request *requests = malloc(2 * (size_t)(peers > 0 ? peers : 1) * sizeof *requests);
    if (!requests) {
        return MPI_ERR_NO_MEM;
    }
    int count = 0, error = MPI_SUCCESS;
    for (int k = 0; k < peers && error == MPI_SUCCESS; k++) {
        error = MPI_Irecv(receive, receive_counts[k], MPI_DOUBLE, ranks[k], 7, MPI_COMM_WORLD, &requests[count++]);
        receive += receive_counts[k];
    }
    for (int k = 0; k < peers && error == MPI_SUCCESS; k++) {
        error = MPI_Isend(send, send_counts[k], MPI_DOUBLE, ranks[k], 7, MPI_COMM_WORLD, &requests[count++]);
        send += send_counts[k];
    }
    if (error == MPI_SUCCESS) {
        error = MPI_Waitall(count, requests, MPI_STATUSES_IGNORE);
    }
    free(requests);
    return error;
}

double shim_time(void) { return MPI_Wtime(); }

/* MUMPS. Its errors are INFOG(1), the same on all ranks, and INFOG(2) says more. */

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
    mumps->rhs = rhs;
    mumps->nrhs = columns;
    mumps->lrhs = dofs;
    mumps->ICNTL(26) = part;
    mumps->redrhs = reduced;
    mumps->lredrhs = last_count;
    return call(mumps, 3);
}
