/* Moves particles of revolution from rest through a fluid at rest by the loads of a surrogate. In this folder:
 *   python ../export_surrogate.py --surrogate pretrained:particle --to c --prefix particle --out particle.c
 *   cc -std=c99 -O3 -march=native -ffp-contract=fast -fopenmp particles.c particle.c -lm -o particles
 *   ./particles COUNT STEPS TIME_STEP < particles.txt > moved.txt
 * Each particle in its own units: length D, time D^2 / nu, mass rho D^3 of the fluid; gravity along -z. A line of
 * input: aspect, beta2, density ratio, g D^3 / nu^2, quaternion w x y z that turns x to the axis, tail to nose, as
 * 2 0 1.2 1000 1 0 0 0. A line of output: position, momentum (with that of the added mass), quaternion, angular
 * velocity in fixed axes. The model is that of shapeopt/free_fall.py in 3-D, the scheme Runge-Kutta's. */
#define PARTICLE_DECLARATIONS
#include "particle.c"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
enum { BLOCK = 128 /* particles at once, a multiple of the export's */, STATE = 13, MOMENTUM = 3, QUATERNION = 6, SPIN = 10 };
static const double PI = 3.14159265358979323846, SLOWEST = 0.1; /* least Re of the training */
typedef struct { double aspect, beta2, along, across, inertia, resistance, weight; } Body;
static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
/* Masses, inertia and resistance to rotation of the spheroid of the same aspect, by potential flow. */
static Body body(double aspect, double beta2, double ratio, double galilei) {
    const double volume = PI / 6, a = pow(aspect, 2.0 / 3) / 2, c = pow(aspect, -1.0 / 3) / 2;
    const double b = aspect > 1 ? 1 / aspect : aspect, e = sqrt(1 - b * b);
    const double prolate = 2 * b * b / (e * e * e) * (atanh(e) - e), oblate = 2 / (e * e) * (1 - b / e * asin(e));
    const double axial = e < 1e-4 ? 2.0 / 3 : aspect > 1 ? prolate : oblate; /* of a sphere, or other spheroids */
    const double side = 1 - axial / 2, sum = a * a + c * c, less = a * a - c * c;
    const double carried = e > 1e-4 ? less * less * (side - axial) / (2 * less + sum * (axial - side)) : 0;
    return (Body){ aspect, beta2, volume * (ratio + axial / (2 - axial)), volume * (ratio + side / (2 - side)),
                   volume / 5 * (ratio * sum + carried),
                   16 * PI * a * c * c * sum / (3 * (a * a * axial + c * c * side)), volume * (ratio - 1) * galilei };
}
/* Derivatives in time of the states of up to BLOCK particles; the status of the surrogate. */
static int rates(int count, const Body *bodies, double (*y)[STATE], double (*by)[STATE]) {
    particle_real inputs[BLOCK][PARTICLE_INPUTS];
    particle_real loads[BLOCK][PARTICLE_LOADS] = { { 0 } }, opposite[BLOCK][PARTICLE_LOADS];
    double along[BLOCK][3], up[BLOCK][3], speed[BLOCK], known[BLOCK], image[BLOCK], slow = 0;
    for (int i = 0; i < count; i++) { /* from the quaternion to the incidence */
        const double *q = y[i] + QUATERNION, *p = y[i] + MOMENTUM, tiny = 1e-24;
        const double axis[3] = { q[0] * q[0] + q[1] * q[1] - q[2] * q[2] - q[3] * q[3],
                                 2 * (q[1] * q[2] + q[0] * q[3]), 2 * (q[1] * q[3] - q[0] * q[2]) }, axial = dot(p, axis);
        for (int k = 0; k < 3; k++)
            by[i][k] = axial / bodies[i].along * axis[k] + (p[k] - axial * axis[k]) / bodies[i].across;
        speed[i] = sqrt(dot(by[i], by[i]) + tiny);
        for (int k = 0; k < 3; k++) along[i][k] = -by[i][k] / speed[i];
        const double cosine = -dot(axis, along[i]);
        for (int k = 0; k < 3; k++) up[i][k] = axis[k] + cosine * along[i][k];
        const double sine = sqrt(dot(up[i], up[i]) + tiny);
        for (int k = 0; k < 3; k++) up[i][k] /= sine;
        known[i] = fmax(speed[i], SLOWEST), slow = fmax(slow, known[i] - speed[i]), image[i] = cosine < 0 ? -1 : 1;
        memcpy(inputs[i], (particle_real[]){ bodies[i].aspect, 1, image[i] * bodies[i].beta2,
                                             atan2(sine, fabs(cosine)) * 180 / PI, known[i] }, sizeof *inputs);
    }
    const int status = particle_loads_batch((size_t)count, inputs[0], loads[0], NULL, NULL);
    memcpy(opposite, loads, sizeof loads);
    for (int i = 0; i < count; i++) inputs[i][2] *= -1; /* beta2, in which the torque by Stokes flow is odd */
    if (slow > 0) particle_loads_batch((size_t)count, inputs[0], opposite[0], NULL, NULL);
    for (int i = 0; i < count; i++) { /* from the loads to force and torque */
        const double *s = along[i], *u = up[i], *q = y[i] + QUATERNION, *w = y[i] + SPIN, force = PI / 8 * speed[i];
        const double stokes = (loads[i][2] - opposite[i][2]) / 2, inertial = loads[i][2] - stokes;
        const double least = known[i] * loads[i][0], creeping = 2 * least / (1 + sqrt(1 + least * known[i] / 32));
        const double drag = least * (128 + creeping * speed[i]) / (128 + creeping * known[i]); /* by Oseen */
        const double lift = known[i] * loads[i][1] * (256 + 5 * creeping * speed[i]) / (256 + 5 * creeping * known[i]);
        for (int k = 0; k < 3; k++) {
            const int m = (k + 1) % 3, n = (k + 2) % 3;
            const double torque = force * image[i] * (known[i] * stokes + speed[i] * inertial) * (u[m] * s[n] - u[n] * s[m]);
            by[i][MOMENTUM + k] = force * (drag * s[k] + image[i] * lift * u[k]) - (k == 2) * bodies[i].weight;
            by[i][SPIN + k] = (torque - bodies[i].resistance * w[k]) / bodies[i].inertia;
            by[i][QUATERNION + 1 + k] = (w[k] * q[0] + w[m] * q[1 + n] - w[n] * q[1 + m]) / 2;
        }
        by[i][QUATERNION] = -(w[0] * q[1] + w[1] * q[2] + w[2] * q[3]) / 2;
    }
    return status;
}
static int step(int count, const Body *bodies, double (*y)[STATE], double time_step) {
    static const double nodes[] = { 0, 0.5, 0.5, 1 }, weights[] = { 1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6 };
    double start[BLOCK][STATE], at[BLOCK][STATE], by[BLOCK][STATE] = { { 0 } };
    int status = 0, stage = 0;
    for (memcpy(start, y, (size_t)count * sizeof *y); stage < 4; stage++) {
        for (int i = 0; i < count; i++)
            for (int k = 0; k < STATE; k++) at[i][k] = start[i][k] + nodes[stage] * time_step * by[i][k];
        status |= rates(count, bodies, at, by);
        for (int i = 0; i < count; i++) for (int k = 0; k < STATE; k++) y[i][k] += weights[stage] * time_step * by[i][k];
    }
    return status;
}
static int whole(const char *word) { /* the number that a word is; 0 for other words, and for large numbers */
    char *end;
    const long number = strtol(word, &end, 10);
    return end != word && !*end && number > 0 && number < 1L << 30 ? (int)number : 0;
}
int main(int words, char **word) {
    const int count = words == 4 ? whole(word[1]) : 0, steps = words == 4 ? whole(word[2]) : 0;
    Body *bodies = malloc((size_t)count * sizeof *bodies);
    double (*y)[STATE] = calloc((size_t)count, sizeof *y), v[4], time_step = words == 4 ? atof(word[3]) : 0;
    int status = 0, read = count > 0 && steps > 0 && time_step > 0 && time_step < 1e9 && bodies && y ? 8 : 0;
    for (int i = 0; i < count && read == 8; i++) {
        double *q = y[i] + QUATERNION;
        read = scanf("%lf%lf%lf%lf%lf%lf%lf%lf", v, v + 1, v + 2, v + 3, q, q + 1, q + 2, q + 3);
        const double size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
        for (int k = 0; k < 4; k++) if (!isfinite(v[k])) read = 0;
        if (!(v[0] > 0 && v[2] > 0 && size > 0 && size < 1e9)) read = 0;
        for (int k = 0; k < 4; k++) q[k] /= size;
        bodies[i] = body(v[0], v[1], v[2], v[3]);
    }
    if (read < 8)
        return fprintf(stderr, "particles: COUNT STEPS TIME_STEP above 0, and COUNT lines as in particles.c\n"), 2;
#pragma omp parallel for schedule(static) reduction(| : status)
    for (int from = 0; from < count; from += BLOCK) for (int n = 0; n < steps; n++)
        status |= step(count - from < BLOCK ? count - from : BLOCK, bodies + from, y + from, time_step);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < STATE; k++) printf("%.12g%c", y[i][k], k < STATE - 1 ? ' ' : '\n');
    return status ? fprintf(stderr, "particles: some were outside the ranges of the surrogate\n"), 1 : 0;
}
