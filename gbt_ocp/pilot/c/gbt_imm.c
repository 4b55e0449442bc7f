#include "gbt_imm.h"

#include "gbt_bearing.h"
#include "gbt_linalg.h"
#include "gbt_math.h"
#include "gbt_mixed.h"

#define D GBT_DIMENSION
#define N GBT_N
#define M GBT_MODES
#define STEADY_VARIANCE ((gbt_real)1e-9) /* of the acceleration under constant velocity, m^2/s^4; 0 would be singular */
#define NEAR ((gbt_real)1e-2)            /* angle below which a quotient that cancels is a series */
#define LEAST_PROBABILITY ((gbt_real)1e-30) /* a mode that is never believed again could never come back */

enum { STEADY, ACCELERATED, TURNING };

void gbt_imm_begin(gbt_imm *imm, const gbt_imm_settings *settings, const gbt_real *position, gbt_real covariance[D][D])
{
    for (int m = 0; m < M; m++) {
        imm->probability[m] = (gbt_real)1 / M;
        for (int i = 0; i < N; i++) {
            imm->mean[m][i] = i < D ? position[i] : i < GBT_KINEMATIC ? 0 : settings->log_size;
            for (int j = 0; j < N; j++)
                imm->covariance[m][i][j] = i < D && j < D      ? covariance[i][j]
                                           : i != j            ? 0
                                           : i < GBT_KINEMATIC ? settings->initial_variance
                                                               : settings->log_size_std * settings->log_size_std;
        }
    }
}

/* ---- motion models ---- */

/* Rate matrix w of the turn of the combined estimate, dv/dt = w v; returns the turn rate. */
static gbt_real turn_of(const gbt_imm *imm, const gbt_imm_settings *settings, gbt_real w[D][D])
{
    gbt_real velocity[D], acceleration[D], square = 0;
    for (int k = 0; k < D; k++) {
        velocity[k] = acceleration[k] = 0;
        for (int m = 0; m < M; m++) {
            velocity[k] += imm->probability[m] * imm->mean[m][D + k];
            acceleration[k] += imm->probability[m] * imm->mean[m][2 * D + k];
        }
    }
    const gbt_real speed = gbt_dot(velocity, velocity);
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++) {
            w[i][j] = speed > 0 ? (acceleration[i] * velocity[j] - velocity[i] * acceleration[j]) / speed : 0;
            square += w[i][j] * w[i][j];
        }
    const gbt_real rate = gbt_sqrt(square / 2);
    if (rate <= settings->turn_rate_max) return rate;
    for (int i = 0; i < D * D; i++) w[i / D][i % D] *= settings->turn_rate_max / rate;
    return settings->turn_rate_max;
}

/* Transition of [p, v, a] over t seconds at a turn: v' = exp(w t) v, p' = p + integral of exp(w s) v, a' = w v'; w^3 = -rate^2 w
   makes both sums of three terms. */
static void coordinated_turn(gbt_real t, gbt_real w[D][D], gbt_real rate, gbt_real transition[N][N])
{
    const gbt_real angle = rate * t, half = angle / 2;
    const gbt_real sine = angle == 0 ? 1 : gbt_sin(angle) / angle, half_sine = angle == 0 ? 1 : gbt_sin(half) / half;
    const gbt_real first = half_sine * half_sine / 2;
    const gbt_real second = gbt_fabs(angle) < NEAR ? (gbt_real)1 / 6 - angle * angle / 120
                                                   : (angle - gbt_sin(angle)) / (angle * angle * angle);
    gbt_real square[D][D], rotation[D][D];
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++) {
            square[i][j] = 0;
            for (int k = 0; k < D; k++) square[i][j] += w[i][k] * w[k][j];
            rotation[i][j] = (gbt_real)(i == j) + sine * t * w[i][j] + first * t * t * square[i][j];
        }
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++) {
            gbt_real turned = 0;
            for (int k = 0; k < D; k++) turned += w[i][k] * rotation[k][j];
            transition[i][j] = i == j;
            transition[i][D + j] = (i == j ? t : 0) + first * t * t * w[i][j] + second * t * t * t * square[i][j];
            transition[D + i][D + j] = rotation[i][j];
            transition[2 * D + i][D + j] = turned;
        }
}

/* Transition of a mode over t seconds. */
static void transition_of(int mode, gbt_real t, gbt_real w[D][D], gbt_real rate, gbt_real transition[N][N])
{
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) transition[i][j] = i == j && i >= GBT_KINEMATIC; /* a size stays what it is */
    if (mode == TURNING) coordinated_turn(t, w, rate, transition);
    for (int k = 0; mode != TURNING && k < D; k++) {
        transition[k][k] = transition[D + k][D + k] = 1;
        transition[k][D + k] = t;
        if (mode == STEADY) continue;
        transition[k][2 * D + k] = t * t / 2;
        transition[D + k][2 * D + k] = t;
        transition[2 * D + k][2 * D + k] = 1;
    }
}

/* Noise of a mode over t seconds between derivatives a and b of one axis. */
static gbt_real noise_of(const gbt_imm_settings *settings, int mode, gbt_real t, int a, int b)
{
    const gbt_real jerk = settings->jerk_noise, process = settings->process_noise;
    const gbt_real of_jerk[3][3] = {{t * t * t * t * t / 20, t * t * t * t / 8, t * t * t / 6},
                                    {t * t * t * t / 8, t * t * t / 3, t * t / 2},
                                    {t * t * t / 6, t * t / 2, t}};
    const gbt_real of_process[3][3] = {{t * t * t / 3, t * t / 2, 0}, {t * t / 2, t, 0}, {0, 0, 0}};
    if (mode == ACCELERATED) return jerk * of_jerk[a][b];
    if (mode == TURNING) return jerk * of_jerk[a][b] + process * of_process[a][b];
    return (a == b ? STEADY_VARIANCE : 0) + process * of_process[a][b];
}

/* ---- the cycle ---- */

void gbt_imm_advance(gbt_imm *imm, const gbt_imm_settings *settings, gbt_real step)
{
    gbt_real w[D][D], ahead[M], transition[N][N], mean[M][N], covariance[M][N][N];
    const gbt_real rate = turn_of(imm, settings, w), other = (1 - settings->stay) / (M - 1);
    for (int m = 0; m < M; m++) {
        ahead[m] = 0;
        for (int k = 0; k < M; k++) ahead[m] += imm->probability[k] * (k == m ? settings->stay : other);
        gbt_real before = 0;
        for (int k = 0; k < M; k++) {
            const gbt_real weight = imm->probability[k] * (k == m ? settings->stay : other);
            gbt_mix(mean[m], covariance[m][0], N, before, weight, imm->mean[k], imm->covariance[k][0]);
            before += weight;
        }
    }
    for (int m = 0; m < M; m++) {
        imm->probability[m] = ahead[m];
        transition_of(m, step, w, rate, transition);
        gbt_congruent(&transition[0][0], &covariance[m][0][0], N, &imm->covariance[m][0][0]);
        for (int k = 0; k < D; k++)
            for (int a = 0; a < 3; a++)
                for (int b = 0; b < 3; b++)
                    imm->covariance[m][a * D + k][b * D + k] += noise_of(settings, m, step, a, b);
        for (int i = 0; i < N; i++) {
            imm->mean[m][i] = 0;
            for (int j = 0; j < N; j++) imm->mean[m][i] += transition[i][j] * mean[m][j];
        }
    }
}

void gbt_imm_weigh(gbt_imm *imm, const gbt_real *log_likelihood)
{
    gbt_real top = -GBT_INFINITY, total = 0;
    for (int m = 0; m < M; m++) top = gbt_fmax(top, log_likelihood[m]);
    if (!isfinite(top)) return;
    for (int m = 0; m < M; m++) total += imm->probability[m] *= gbt_exp(log_likelihood[m] - top);
    for (int m = 0; m < M; m++) imm->probability[m] = gbt_fmax(imm->probability[m] / total, LEAST_PROBABILITY);
}

void gbt_imm_forecast(const gbt_imm *imm, const gbt_imm_settings *settings, gbt_real ahead, gbt_real *mean,
                      gbt_real *covariance)
{
    gbt_real w[D][D], transition[N][N], half[N], place[D], spread[D * D], before = 0;
    const gbt_real rate = turn_of(imm, settings, w);
    for (int m = 0; m < M; m++) {
        transition_of(m, ahead, w, rate, transition);
        const gbt_real noise = noise_of(settings, m, ahead, 0, 0);
        for (int i = 0; i < D; i++) {
            place[i] = 0;
            for (int j = 0; j < N; j++) {
                place[i] += transition[i][j] * imm->mean[m][j];
                half[j] = 0;
                for (int k = 0; k < N; k++) half[j] += transition[i][k] * imm->covariance[m][k][j];
            }
            for (int j = 0; j <= i; j++) {
                gbt_real sum = i == j ? noise : 0;
                for (int k = 0; k < N; k++) sum += half[k] * transition[j][k];
                spread[i * D + j] = spread[j * D + i] = sum;
            }
        }
        gbt_mix(mean, covariance, D, before, imm->probability[m], place, spread);
        before += imm->probability[m];
    }
}
