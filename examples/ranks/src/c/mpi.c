/* What is called of MPI, with plain numbers and pointers only: its handles are other types in each implementation, and
 * stay on this side. All functions return 0, or an error of MPI. */

#include <mpi.h>
#include <stdlib.h>

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
