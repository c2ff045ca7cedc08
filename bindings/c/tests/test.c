/* Tests of the C interface: a bar against the closed form, faults, and freeing. */
#include <contact_dynamics.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void check(int is_true, const char *condition, int line) {
  if (!is_true) {
    fprintf(stderr, "line %d: %s\n  last error: %s\n", line, condition, cd_last_error());
    exit(EXIT_FAILURE);
  }
}

#define CHECK(condition) check((condition) ? 1 : 0, #condition, __LINE__)
#define OK(call) CHECK((call) == CD_OK)
/* The status, and a part of the message. */
#define FAILS(expected, text, call) CHECK((call) == (expected) && strstr(cd_last_error(), text))

enum { ELEMENTS = 20, NODES = ELEMENTS + 1 };
static const double SIZE = 10.0 / ELEMENTS, STIFFNESS = 25.0, DENSITY = 0.0025, SPEED = 0.05, GAP = 0.005;
static double masses[NODES], velocity[NODES], data[3 * NODES];
static size_t indptr[NODES + 1], indices[3 * NODES];
static cd_matrix stiffness = {NODES, 0, indptr, indices, data};

static void assemble(void) {
  size_t entries = 0;
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
  stiffness.entries = entries;
}

static cd_model *bar(void) {
  cd_model *model;
  OK(cd_model_new_lumped(masses, NODES, &stiffness, &model));
  return model;
}

static cd_run *run_of(cd_model *model, cd_settings settings) {
  cd_run *run;
  OK(cd_build(model, 1e-3, &settings, &run));
  OK(cd_model_free(model));
  return run;
}

static void add_wall(cd_model *model) {
  const size_t row[] = {0, 1}, last[] = {ELEMENTS};
  const double toward = -1.0;
  const cd_matrix wall = {1, 1, row, last, &toward};
  OK(cd_model_rows(model, &wall, &GAP, NULL, NULL));
}

static const cd_settings FLIES = {.n = NODES, .velocity = velocity, .energy_balance = true};

/* The force is rho c A v while the bar touches; its energy is that at the start. */
static void has_exact_force(cd_run *run) {
  const double exact = SPEED * sqrt(STIFFNESS * DENSITY), start = 0.5 * DENSITY * 10.0 * SPEED * SPEED;
  double t, forces[NODES], u[NODES], v[NODES], a[NODES];
  cd_contact contact;
  cd_energies energies;
  size_t count;
  OK(cd_run_until(run, 0.2));
  OK(cd_time(run, &t));
  CHECK(fabs(t - 0.2) < 1e-9);
  OK(cd_contacts(run, NULL, 0, &count));
  CHECK(count == 1);
  OK(cd_contacts(run, &contact, 1, &count));
  CHECK(count == 1 && contact.status == CD_CLOSED && contact.constraint == 0 && contact.feature == 0);
  CHECK(fabs(contact.force / exact - 1) < 0.02 && fabs(contact.gap) < 1e-12);
  OK(cd_contact_forces(run, forces, NODES));
  CHECK(forces[ELEMENTS] == -contact.force && forces[0] == 0.0);
  OK(cd_displacement(run, u, NODES));
  OK(cd_velocity(run, v, NODES));
  OK(cd_acceleration(run, a, NODES));
  CHECK(fabs(u[ELEMENTS] - GAP) < 1e-12 && fabs(v[ELEMENTS]) < 1e-12 && fabs(a[ELEMENTS]) < 1e-9);
  OK(cd_energy(run, &energies));
  CHECK(fabs((energies.kinetic + energies.potential) / start - 1) < 0.05);
  CHECK(energies.impacts < 0.0 && energies.load == 0.0);
}

static void a_bar_has_the_exact_force(void) {
  cd_model *model = bar();
  add_wall(model);
  cd_run *run = run_of(model, FLIES);
  has_exact_force(run);
  OK(cd_run_free(run));
}

static int gap_of_wall(double t, const double *x, const double *v, double *gradient, size_t n, double *gap, void *to) {
  (void)t, (void)v, (void)to;
  CHECK(n == 1);
  gradient[0] = -1.0;
  gap[0] = GAP - x[0];
  gap[1] = gap[2] = 0.0;
  return 0;
}

static void a_gap_by_a_function_has_the_exact_force(void) {
  const size_t last = ELEMENTS;
  cd_model *model = bar();
  OK(cd_model_gap(model, &last, 1, gap_of_wall, NULL, 0.0, NULL));
  cd_run *run = run_of(model, FLIES);
  has_exact_force(run);
  OK(cd_run_free(run));
}

/* A particle of mass 1 without stiffness, in two or three dimensions. */
static cd_model *particle(size_t n) {
  const double one[3] = {1, 1, 1};
  const size_t none[4] = {0};
  const cd_matrix free_motion = {n, 0, none, NULL, NULL};
  cd_model *model;
  OK(cd_model_new_lumped(one, n, &free_motion, &model));
  return model;
}

static void particles_meet_obstacles(void) {
  /* It slides on a floor: weight 10, friction 0.5, pulled by 2 and held. */
  const double at[3] = {0}, up[3] = {0, 0, 1}, load[3] = {2, 0, -10}, place[3] = {3, 0, 0}, below[3] = {3, 0, -1};
  const size_t node = 0;
  const cd_mesh mesh = {3, 1, place, NULL};
  cd_model *model = particle(3);
  OK(cd_model_constant_load(model, load, 3));
  OK(cd_model_plane(model, &mesh, &node, 1, at, up, &(cd_surface){.friction = 0.5}));
  /* The same model builds several runs. */
  for (int i = 0; i < 2; i++) {
    cd_run *run;
    cd_contact contact;
    size_t count;
    OK(cd_build(model, 0.1, &(cd_settings){.scheme = "bathe rho=0.5", .correction = "none"}, &run));
    OK(cd_step(run));
    OK(cd_contacts(run, &contact, 1, &count));
    CHECK(contact.status == CD_STICKING && fabs(contact.force - 10.0) < 1e-9 && contact.normal[2] == 1.0);
    CHECK(fabs(hypot(contact.friction[0], contact.friction[1]) - 2.0) < 1e-9 && fabs(contact.position[0] - 3.0) < 1e-9);
    OK(cd_run_free(run));
  }
  OK(cd_model_free(model));

  /* It rests on a ball by a spring, stiffness 1000. */
  model = particle(3);
  OK(cd_model_constant_load(model, load, 3));
  OK(cd_model_fix(model, (const size_t[]){0, 1}, 2));
  OK(cd_model_sphere(model, &mesh, &node, 1, below, 1.0, false, &(cd_surface){.law = "penalty stiffness=1000"}));
  cd_run *run;
  const double pressed[3] = {0, 0, -0.01};
  double u[3], reactions[2];
  OK(cd_build(model, 0.01, &(cd_settings){.n = 3, .displacement = pressed}, &run));
  OK(cd_step(run));
  OK(cd_displacement(run, u, 3));
  CHECK(fabs(u[2] + 0.01) < 1e-6);
  OK(cd_reactions(run, reactions, 2));
  CHECK(fabs(reactions[0] + 2.0) < 1e-6);
  OK(cd_run_free(run));
  OK(cd_model_free(model));
}

/* The top side of a fixed square, and a triangle whose corner falls on it. */
static void bodies_meet(void) {
  const double coordinates[] = {0, 0, 1, 0, 0.5, 0.01, 0.8, 0.5, 0.2, 0.5};
  const size_t side[] = {1, 0}, corner[] = {4, 2, 2, 3, 3, 4}, fixed[] = {0, 1, 2, 3};
  double mass[10], load[10], forces[10];
  size_t none[11] = {0};
  for (int i = 0; i < 10; i++) {
    mass[i] = 1.0;
    load[i] = i % 2 && i > 3 ? -1.0 : 0.0;
  }
  const cd_matrix loose = {10, 0, none, NULL, NULL};
  const cd_mesh mesh = {2, 5, coordinates, NULL};
  const cd_facets above = {3, 2, corner}, below = {1, 2, side};
  cd_model *model;
  cd_run *run;
  OK(cd_model_new_lumped(mass, 10, &loose, &model));
  OK(cd_model_fix(model, fixed, 4));
  OK(cd_model_constant_load(model, load, 10));
  OK(cd_model_bodies(model, &mesh, &above, &below, NULL));
  OK(cd_build(model, 0.01, NULL, &run));
  OK(cd_run_until(run, 0.3));
  OK(cd_contact_forces(run, forces, 10));
  CHECK(fabs(forces[5] - 1.0) < 1e-6 && fabs(forces[1] + forces[3] + 1.0) < 1e-6);
  OK(cd_run_free(run));
  OK(cd_model_free(model));
}

static void arguments_are_checked(void) {
  cd_model *model = bar(), *none = model;
  cd_run *run = (cd_run *)model;
  double values[NODES] = {0};
  const size_t beyond = NODES;
  CHECK(strcmp(cd_version(), "0.1.0") == 0);
  FAILS(CD_INVALID, "the model is NULL", cd_model_rayleigh(NULL, 0.0, 0.0));
  FAILS(CD_INVALID, "NULL", cd_model_new_lumped(masses, NODES, &stiffness, NULL));
  FAILS(CD_INVALID, "the stiffness matrix is NULL", cd_model_new_lumped(masses, NODES, NULL, &none));
  CHECK(none == NULL);
  FAILS(CD_INVALID, "the mass: the array is NULL", cd_model_new_lumped(NULL, NODES, &stiffness, &none));
  FAILS(CD_INVALID, "expected", cd_model_new_lumped(masses, NODES - 1, &stiffness, &none));
  FAILS(CD_INVALID, "the array is NULL", cd_model_constant_load(model, NULL, NODES));
  FAILS(CD_INVALID, "the load has size 3, expected 21", cd_model_constant_load(model, values, 3));
  FAILS(CD_INVALID, "names dof 21, but the system has 21 dofs", cd_model_fix(model, &beyond, 1));
  FAILS(CD_INVALID, "the load is NULL", cd_model_load(model, NULL, NULL));
  values[2] = NAN;
  FAILS(CD_INVALID, "the load is not finite at index 2: NaN", cd_model_constant_load(model, values, NODES));
  FAILS(CD_INVALID, "Rayleigh", cd_model_rayleigh(model, NAN, 0.0));
  FAILS(CD_INVALID, "velocity", cd_build(model, 1e-3, &(cd_settings){.n = NODES, .velocity = values}, &run));
  CHECK(run == NULL);
  FAILS(CD_INVALID, "expected 21", cd_build(model, 1e-3, &(cd_settings){.n = 4, .velocity = velocity}, &run));
  FAILS(CD_INVALID, "step", cd_build(model, NAN, NULL, &run));
  FAILS(CD_INVALID, "no scheme \"leapfrog\"; the names are generalized-alpha",
        cd_build(model, 1e-3, &(cd_settings){.scheme = "leapfrog"}, &run));
  FAILS(CD_INVALID, "no parameter beta", cd_build(model, 1e-3, &(cd_settings){.scheme = "bathe beta=1"}, &run));
  FAILS(CD_INVALID, "is not parameter=number", cd_build(model, 1e-3, &(cd_settings){.scheme = "bathe rho=x"}, &run));
  FAILS(CD_INVALID, "no correction", cd_build(model, 1e-3, &(cd_settings){.correction = "some"}, &run));
  FAILS(CD_REFUSED, "stability limit", cd_build(model, 1.0, &(cd_settings){.scheme = "central-difference"}, &run));

  cd_matrix wrong = stiffness;
  wrong.entries -= 1;
  FAILS(CD_INVALID, "the stiffness matrix", cd_model_new_lumped(masses, NODES, &wrong, &none));
  size_t falling[NODES + 1] = {0, 5, 3};
  wrong = stiffness;
  wrong.indptr = falling;
  FAILS(CD_INVALID, "the damping matrix", cd_model_damping(model, &wrong));
  FAILS(CD_INVALID, "indptr does not rise", cd_model_rows(model, &wrong, velocity, NULL, NULL));
  data[4] = NAN;
  FAILS(CD_INVALID, "not finite at index 4", cd_model_new_lumped(masses, NODES, &stiffness, &none));
  assemble();

  const cd_mesh flat = {1, NODES, velocity, NULL}, small = {2, 4, velocity, NULL};
  const double normal[2] = {0};
  FAILS(CD_INVALID, "the dimension of the mesh is 1", cd_model_plane(model, &flat, NULL, 0, normal, normal, NULL));
  FAILS(CD_INVALID, "the mesh is NULL", cd_model_bodies(model, NULL, NULL, NULL, NULL));
  CHECK(cd_model_plane(model, &small, &beyond, 1, normal, normal, NULL) != CD_OK);
  const cd_surface rough = {-1.0, NULL}, sticky = {0.0, "glue"}, dry = {0.5, NULL};
  FAILS(CD_INVALID, "friction coefficient", cd_model_gap(model, NULL, 0, gap_of_wall, NULL, 0.0, &rough));
  FAILS(CD_INVALID, "no contact law \"glue\"", cd_model_gap(model, NULL, 0, gap_of_wall, NULL, 0.0, &sticky));
  FAILS(CD_INVALID, "but no tangents", cd_model_rows(model, &stiffness, velocity, NULL, &dry));

  OK(cd_build(model, 1e-3, NULL, &run));
  FAILS(CD_INVALID, "has size 20, expected 21", cd_displacement(run, values, NODES - 1));
  FAILS(CD_INVALID, "the array is NULL", cd_velocity(run, NULL, NODES));
  FAILS(CD_INVALID, "the time: the array is NULL", cd_time(run, NULL));
  FAILS(CD_INVALID, "the end time", cd_run_until(run, NAN));
  FAILS(CD_INVALID, "the run is NULL", cd_step(NULL));
  OK(cd_run_free(run));
  OK(cd_model_free(model));
  OK(cd_run_free(NULL));
  OK(cd_model_free(NULL));
}

/* A load that behaves until a time, then does one of several things. */
struct host {
  double until;
  int then;
  cd_run *run;
  cd_status inside;
};

static int moody_load(double t, double *f, size_t n, void *user) {
  struct host *host = user;
  for (size_t i = 0; i < n; i++) {
    f[i] = t > host->until && host->then < 0 ? NAN : 0.0;
  }
  host->inside = host->run ? cd_step(host->run) : CD_OK;
  return t > host->until && host->then > 0 ? host->then : 0;
}

static void a_failed_step_changes_nothing(void) {
  const struct {
    int then;
    cd_status status;
    const char *text;
  } faults[] = {
      {7, CD_CALLBACK, "the host's load failed: it returned 7"},
      {CD_INADMISSIBLE, CD_REFUSED, "the host's load does not admit the state of a step"},
      {-1, CD_REFUSED, "t = "},
  };
  for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
    struct host host = {0.15, faults[i].then, NULL, CD_OK};
    cd_model *model = bar();
    add_wall(model);
    OK(cd_model_load(model, moody_load, &host));
    cd_run *run = run_of(model, FLIES);
    FAILS(faults[i].status, faults[i].text, cd_run_until(run, 0.2));
    double t[2], before[3][NODES], after[3][NODES];
    cd_contact contacts[2];
    size_t count;
    for (int k = 0; k < 2; k++) {
      double(*state)[NODES] = k ? after : before;
      OK(cd_time(run, &t[k]));
      OK(cd_displacement(run, state[0], NODES));
      OK(cd_velocity(run, state[1], NODES));
      OK(cd_acceleration(run, state[2], NODES));
      OK(cd_contacts(run, &contacts[k], 1, &count));
      FAILS(faults[i].status, faults[i].text, cd_step(run));
    }
    CHECK(t[0] == t[1] && t[0] > 0.14 && t[0] < 0.1501 && memcmp(before, after, sizeof before) == 0);
    CHECK(contacts[0].force == contacts[1].force && contacts[0].force > 0.0);
    /* It goes on from there. */
    host.until = 1.0;
    has_exact_force(run);
    OK(cd_run_free(run));
  }
}

static void a_callback_cannot_use_its_run(void) {
  struct host host = {1.0, 0, NULL, CD_OK};
  cd_model *model = bar();
  OK(cd_model_load(model, moody_load, &host));
  host.run = run_of(model, FLIES);
  OK(cd_step(host.run));
  CHECK(host.inside == CD_BUSY && strstr(cd_last_error(), "the run is in use"));
  OK(cd_run_free(host.run));
}

static void *in_thread(void *unused) {
  CHECK(strcmp(cd_last_error(), "") == 0);
  a_bar_has_the_exact_force();
  FAILS(CD_INVALID, "the run is NULL", cd_step(NULL));
  return unused;
}

static void handles_work_in_threads(void) {
  pthread_t threads[2];
  FAILS(CD_INVALID, "the model is NULL", cd_model_rayleigh(NULL, 0.0, 0.0));
  for (int i = 0; i < 2; i++) {
    CHECK(pthread_create(&threads[i], NULL, in_thread, NULL) == 0);
  }
  for (int i = 0; i < 2; i++) {
    CHECK(pthread_join(threads[i], NULL) == 0);
  }
  CHECK(strcmp(cd_last_error(), "the model is NULL") == 0);
}

int main(void) {
  assemble();
  a_bar_has_the_exact_force();
  a_gap_by_a_function_has_the_exact_force();
  particles_meet_obstacles();
  bodies_meet();
  arguments_are_checked();
  a_failed_step_changes_nothing();
  a_callback_cannot_use_its_run();
  handles_work_in_threads();
  printf("all tests passed\n");
  return 0;
}
