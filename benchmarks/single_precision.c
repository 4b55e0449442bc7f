/* Plans in single precision beside those in double, step by step along closed loops; see single_precision.py.

   precision SEEDS STEPS SETTING VALUE     SETTING: of the planner in single precision, "none" for its defaults

   Each loop begins at rest at a random place, with a target that drifts by and a forecast that sharpens. The plans in
   double precision are followed; those in single precision begin from the same state and the same previous plan. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "double_gbt_plan.h"
#include "single_gbt_plan.h"

enum {
    P = DOUBLE_GBT_PIECES,
    D = DOUBLE_GBT_DIMENSION,
    F = DOUBLE_GBT_FLAT,
    FREE = DOUBLE_GBT_FREE,
    STATE = DOUBLE_GBT_STATE,
    ROWS = P + DOUBLE_GBT_PRESENT
};

static const double turn = 6.283185307179586;

static double_gbt_planner wide;
static single_gbt_planner narrow;
static double_gbt_plan_result wanted;
static single_gbt_plan_result found;

static struct {
    double state[STATE], mean[ROWS * D], covariance[ROWS * D * D], desired[P * D];
} in;
static struct {
    float state[STATE], mean[ROWS * D], covariance[ROWS * D * D], desired[P * D];
} cut;

static double uniform(void) { return 2.0 * rand() / RAND_MAX - 1; }

static double normal(void)
{
    double sum = -6;
    for (int k = 0; k < 12; k++) sum += rand() / (double)RAND_MAX;
    return sum;
}

/* The forecast of step k, for a target with this velocity. */
static void foresee(int k, const double *velocity, double phase)
{
    const double period = (double)DOUBLE_GBT_PERIOD, spread = 0.02 + exp(-k / 5.0);
    double error[D], root[D][D];
    for (int j = 0; j < D; j++) error[j] = 0.3 * spread * normal();
    for (int i = 0; i < ROWS; i++) {
        const double t = (k + i + 1 - DOUBLE_GBT_PRESENT) * period;
        for (int a = 0; a < D * D; a++) root[a / D][a % D] = spread * normal();
        for (int a = 0; a < D; a++) {
            in.mean[i * D + a] = t * velocity[a] + error[a];
            for (int b = 0; b < D; b++) {
                double sum = 0;
                for (int c = 0; c < D; c++) sum += root[a][c] * root[b][c];
                in.covariance[(i * D + a) * D + b] = sum;
            }
        }
    }
    for (int i = 0; i < P; i++) {
        const double angle = phase + turn / 10 * (k + i + 1);
        for (int j = 0; j < D; j++) in.desired[i * D + j] = j == 0 ? cos(angle) : j == 1 ? sin(angle) : 0;
    }
}

static void narrow_inputs(void)
{
    for (int a = 0; a < STATE; a++) cut.state[a] = (float)in.state[a];
    for (int a = 0; a < ROWS * D; a++) cut.mean[a] = (float)in.mean[a];
    for (int a = 0; a < ROWS * D * D; a++) cut.covariance[a] = (float)in.covariance[a];
    for (int a = 0; a < P * D; a++) cut.desired[a] = (float)in.desired[a];
    narrow.warm = wide.warm;
    for (int j = 0; j < D; j++) narrow.place[j] = wide.place[j];
    for (int a = 0; a < STATE; a++) narrow.begin[a] = (float)wide.begin[a];
    for (int a = 0; a < P * FREE; a++) narrow.previous[a / FREE][a % FREE] = (float)wide.previous[a / FREE][a % FREE];
}

static double difference(void)
{
    double worst = 0;
    for (int a = 0; a < P * F; a++) {
        const double own = fabs(wanted.endpoints[a / F][a % F] - (double)found.endpoints[a / F][a % F]);
        if (!(own <= worst)) worst = own;
    }
    return worst;
}

static int set(const char *name, double value)
{
    single_gbt_settings *s = &narrow.settings;
    if (strcmp(name, "tolerance") == 0) s->tolerance = (float)value;
    else if (strcmp(name, "gap") == 0) s->gap = (float)value;
    else if (strcmp(name, "feasibility") == 0) s->feasibility = (float)value;
    else return strcmp(name, "none") == 0;
    return 1;
}

int main(int count, char **arguments)
{
    if (count != 5) return 64;
    for (int seed = 1; seed <= atoi(arguments[1]); seed++) {
        double velocity[D];
        srand((unsigned)seed);
        double_gbt_plan_init(&wide);
        single_gbt_plan_init(&narrow);
        if (!set(arguments[3], atof(arguments[4]))) return 64;
        memset(&in, 0, sizeof in);
        const double phase = 3 * uniform();
        for (int j = 0; j < D; j++) {
            velocity[j] = 0.5 * normal();
            in.state[j] = 3 * uniform();
        }
        for (int k = 0; k < atoi(arguments[2]); k++) {
            foresee(k, velocity, phase);
            narrow_inputs();
            double_gbt_plan(&wide, in.state, in.mean, in.covariance, in.desired, &wanted);
            single_gbt_plan(&narrow, cut.state, cut.mean, cut.covariance, cut.desired, &found);
            /* one line a step: of double precision, then of single */
            printf("%d %d %d %d %d %d %.9g %.9g %.9g %.9g\n", (int)wanted.status, (int)wanted.origin, wanted.iterations,
                   (int)found.status, (int)found.origin, found.iterations, wanted.objective, (double)found.objective,
                   (double)found.piece_violation[0], difference());
            for (int j = 0; j < F; j++)
                for (int l = 0; l < DOUBLE_GBT_JOINED; l++)
                    in.state[l * F + j] = l == 0 ? wanted.endpoints[0][j] : l == 1 ? wanted.rates[0][j] : 0;
        }
    }
    return 0;
}
