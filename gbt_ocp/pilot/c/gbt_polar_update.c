#include "gbt_polar_update.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define N GBT_N
#define MOVING GBT_KINEMATIC
#define LONGEST_LOG_STEP ((gbt_real)5) /* largest step of the log range in one update */

void gbt_own_velocity(gbt_own_velocities *own, const gbt_sighting *sighting)
{
    const int k = sighting->sensor;
    if (own->seen[k] && !(sighting->time > own->time[k])) return;
    if (own->seen[k])
        for (int j = 0; j < D; j++)
            own->velocity[j] = (sighting->position[j] - own->position[k][j]) / (gbt_real)(sighting->time - own->time[k]);
    own->seen[k] = 1;
    own->time[k] = sighting->time;
    for (int j = 0; j < D; j++) own->position[k][j] = sighting->position[j];
}

/* Derivatives of a relative state by direction, log range, derivatives over the range, and log size. */
static void slopes_of(const gbt_real *relative, gbt_real distance, gbt_real basis[GBT_AXES][D], gbt_real slopes[N][N])
{
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) slopes[i][j] = 0;
    for (int i = 0; i < D; i++)
        for (int a = 0; a < GBT_AXES; a++) slopes[i][a] = distance * basis[a][i];
    for (int i = 0; i < MOVING; i++) slopes[i][D - 1] = relative[i];
    for (int i = D; i < N; i++) slopes[i][i] = i < MOVING ? distance : 1;
}

/* The basis of the tangent plane, turned along with its direction. */
static void carry(gbt_real basis[GBT_AXES][D], const gbt_real *before, const gbt_real *after)
{
    const gbt_real weight = gbt_fmax(1 + gbt_dot(before, after), (gbt_real)1e-9);
    for (int a = 0; a < GBT_AXES; a++) {
        const gbt_real along = gbt_dot(after, basis[a]) / weight;
        for (int k = 0; k < D; k++) basis[a][k] -= (before[k] + after[k]) * along;
    }
}

int gbt_polar_update(gbt_real mean[N], gbt_real covariance[N][N], const gbt_polar_rows *rows, const gbt_real *own,
                     const gbt_real *own_velocity, gbt_real *log_likelihood)
{
    gbt_real basis[GBT_AXES][D], relative[N], slopes[N][N], inward[N][N], polar[N][N], step[N], unit[D];
    gbt_real observation[GBT_MOST_ROWS][N], after[N];
    gbt_tangent_basis(rows->unit, basis);
    for (int i = 0; i < N; i++) {
        relative[i] = i < D ? rows->range * rows->unit[i] : i < 2 * D ? mean[i] - own_velocity[i - D] : mean[i];
        step[i] = 0;
        for (int j = 0; j < N; j++) inward[i][j] = i == j;
    }
    slopes_of(relative, rows->range, basis, slopes);
    if (!gbt_solve_square(&slopes[0][0], N, &inward[0][0], N)) return 0;
    gbt_congruent(&inward[0][0], &covariance[0][0], N, &polar[0][0]);
    for (int r = 0; r < rows->rows; r++) {
        for (int j = 0; j < N; j++) observation[r][j] = j >= MOVING ? rows->size[r] : 0;
        for (int a = 0; a < GBT_AXES; a++) observation[r][a] = gbt_dot(rows->across[r], basis[a]);
        observation[r][D - 1] = rows->along[r];
    }
    if (!gbt_kalman_update(step, polar, rows->rows, observation, rows->std, rows->residuals, log_likelihood)) return 0;

    const gbt_real farther = gbt_fmin(gbt_fmax(step[D - 1], -LONGEST_LOG_STEP), LONGEST_LOG_STEP);
    const gbt_real distance = rows->range * gbt_exp(farther), scale = distance / rows->range;
    gbt_rotate_bearing(rows->unit, step, unit);
    for (int i = 0; i < N; i++)
        after[i] = i < D ? distance * unit[i] : i < MOVING ? scale * relative[i] + distance * step[i] : relative[i] + step[i];
    carry(basis, rows->unit, unit);
    slopes_of(after, distance, basis, slopes);
    gbt_congruent(&slopes[0][0], &polar[0][0], N, &covariance[0][0]);
    for (int i = 0; i < N; i++) mean[i] = after[i] + (i < D ? own[i] : i < 2 * D ? own_velocity[i - D] : 0);
    return 1;
}
