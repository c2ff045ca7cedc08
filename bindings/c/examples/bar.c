/* An elastic bar flies against a rigid wall: its contact force beside the closed form F = rho c A v. */
#include <contact_dynamics.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* 40 elements: L = 10 m, EA = 25 N, rho A = 0.0025 kg/m, v = 0.05 m/s; the wall is 5 mm ahead of the last node. */
enum { ELEMENTS = 40, NODES = ELEMENTS + 1 };
static const double SIZE = 10.0 / ELEMENTS, STIFFNESS = 25.0, DENSITY = 0.0025, SPEED = 0.05, GAP = 0.005;

static void check(cd_status status) {
  if (status != CD_OK) {
    fprintf(stderr, "error %d: %s\n", status, cd_last_error());
    exit(EXIT_FAILURE);
  }
}

int main(void) {
  /* Lumped masses, and the stiffness by rows: three entries each, two at the ends. */
  double masses[NODES], velocity[NODES], data[3 * NODES];
  size_t indptr[NODES + 1] = {0}, indices[3 * NODES], entries = 0;
  for (size_t i = 0; i < NODES; i++) {
    const int neighbors = (i > 0) + (i < ELEMENTS);
    masses[i] = 0.5 * DENSITY * SIZE * neighbors;
    velocity[i] = SPEED;
    for (size_t j = i - (i > 0); j <= i + (i < ELEMENTS); j++) {
      indices[entries] = j;
      data[entries++] = STIFFNESS / SIZE * (i == j ? neighbors : -1);
    }
    indptr[i + 1] = entries;
  }
  const cd_matrix stiffness = {NODES, entries, indptr, indices, data};
  cd_model *model;
  check(cd_model_new_lumped(masses, NODES, &stiffness, &model));

  /* The gap of the last node: GAP - u. */
  const size_t row[] = {0, 1}, last[] = {ELEMENTS};
  const double toward = -1.0;
  const cd_matrix wall = {1, 1, row, last, &toward};
  check(cd_model_rows(model, &wall, &GAP, NULL, NULL));

  /* Scheme and correction are the defaults of the library. */
  const cd_settings settings = {.n = NODES, .velocity = velocity};
  cd_run *run;
  check(cd_build(model, 1e-3, &settings, &run));
  check(cd_model_free(model));

  const double exact = SPEED * sqrt(STIFFNESS * DENSITY);
  printf("%8s %12s %12s\n", "t [s]", "force [N]", "exact [N]");
  for (int i = 1; i <= 8; i++) {
    double t;
    cd_contact contact;
    size_t count;
    check(cd_run_until(run, 0.05 * i - 0.025));
    check(cd_time(run, &t));
    check(cd_contacts(run, &contact, 1, &count));
    /* The bar touches from GAP / v until a wave has run to its free end and back: 2 L / c later. */
    const int touches = t > GAP / SPEED && t < GAP / SPEED + 20.0 / sqrt(STIFFNESS / DENSITY);
    printf("%8.3f %12.6f %12.6f\n", t, contact.force, touches ? exact : 0.0);
  }
  check(cd_run_free(run));
  return 0;
}
