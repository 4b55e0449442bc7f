#include "gbt_current.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define D GBT_DIMENSION
#define M GBT_INPUTS
#define TURN ((gbt_real)6.283185307179586)

#if GBT_CURRENT
void gbt_current_begin(gbt_current *current)
{
    *current = (gbt_current){0};
    for (int p = 0; p < D; p++) {
        current->velocity[p] = current->planned_for[p] = gbt_pilot_numbers.current[p];
        current->spread[p][p] = gbt_pilot_numbers.current_std * gbt_pilot_numbers.current_std;
    }
}

void gbt_through_water(const gbt_current *current, gbt_real flat[GBT_JOINED][GBT_FLAT])
{
    for (int p = 0; p < D; p++) flat[1][p] -= current->velocity[p];
}

void gbt_drift(const gbt_current *current, const gbt_forecast *forecast, gbt_forecast *drifting)
{
    *drifting = *forecast;
    for (int k = 0; k <= GBT_AHEAD; k++) {
        const gbt_real ahead = (gbt_real)(gbt_pilot_numbers.forecast_period * k);
        for (int p = 0; p < D; p++) drifting->mean[k][p] -= ahead * current->velocity[p];
    }
}
#endif

#if GBT_CURRENT == 2
static void forget_first(gbt_current *current)
{
    for (int k = 1; k < current->commands; k++) current->command[k - 1] = current->command[k];
    current->commands--;
}

void gbt_current_command(gbt_current *current, double time, const gbt_real *thrust)
{
    if (current->commands == GBT_COMMANDS) forget_first(current);
    current->command[current->commands].time = time;
    for (int i = 0; i < M; i++) current->command[current->commands].thrust[i] = thrust[i];
    current->commands++;
}

/* Mean of the thrusts that were held from one time to another. */
static void mean_thrust(const gbt_current *current, double begin, double end, gbt_real *mean)
{
    for (int i = 0; i < M; i++) mean[i] = 0;
    for (int k = 0; k < current->commands; k++) {
        const double until = k + 1 < current->commands ? current->command[k + 1].time : HUGE_VAL;
        const double held = fmin(until, end) - fmax(current->command[k].time, begin);
        for (int i = 0; i < M && held > 0; i++) mean[i] += (gbt_real)held * current->command[k].thrust[i];
    }
    for (int i = 0; i < M; i++) mean[i] /= (gbt_real)(end - begin);
}

/* An extended Kalman filter of the velocity, whose measurement is what the inputs differ from those that the model needs
   in the middle of the time. Joseph's form keeps the covariance positive definite. */
static void observe(gbt_current *current, const gbt_own_state *before, const gbt_own_state *after)
{
    const gbt_real duration = (gbt_real)(after->time - before->time);
    const gbt_pilot_settings *numbers = &gbt_pilot_numbers;
    gbt_real point[3 * GBT_FLAT], thrust[M], out[M + M * D + M * GBT_FLAT], squares = 0;
    gbt_real noise[M * M], sum[M * M], gain[M * D], kept[D][D], spread[D][D];
    for (int j = 0; j < GBT_FLAT; j++) {
        const gbt_real moved = after->pose[j] - before->pose[j], faster = after->rates[j] - before->rates[j];
        /* an angle may have passed a full turn; the middle is on the short way */
        point[j] = before->pose[j] + (j < D ? moved : gbt_remainder(moved, TURN)) / 2;
        point[GBT_FLAT + j] = before->rates[j] + faster / 2;
        point[2 * GBT_FLAT + j] = faster / duration;
        squares += faster / duration * (faster / duration);
    }
    mean_thrust(current, before->time, after->time, thrust);
    gbt_current_model(point, current->velocity, thrust, out);
    const gbt_real *innovation = out, *slope = out + M, *mass = out + M + M * D;
    for (int i = 0; i < M; i++)
        if (!isfinite(innovation[i])) return;
    const gbt_real variance = numbers->acceleration_std * numbers->acceleration_std +
                              numbers->acceleration_share * numbers->acceleration_share * squares;
    for (int p = 0; p < D; p++) {
        for (int q = 0; q < D; q++) spread[p][q] = current->spread[p][q];
        spread[p][p] += numbers->current_drift * numbers->current_drift * duration;
    }
    for (int i = 0; i < M; i++)
        for (int p = 0; p < D; p++) {
            gain[i * D + p] = 0; /* first the slopes times the spread */
            for (int q = 0; q < D; q++) gain[i * D + p] += slope[i * D + q] * spread[q][p];
        }
    for (int i = 0; i < M; i++)
        for (int k = 0; k < M; k++) {
            noise[i * M + k] = 0;
            for (int j = 0; j < GBT_FLAT; j++)
                noise[i * M + k] += variance * mass[i * GBT_FLAT + j] * mass[k * GBT_FLAT + j];
            sum[i * M + k] = noise[i * M + k];
            for (int p = 0; p < D; p++) sum[i * M + k] += gain[i * D + p] * slope[k * D + p];
        }
    if (!gbt_solve_square(sum, M, gain, D)) return;
    for (int p = 0; p < D; p++) {
        for (int i = 0; i < M; i++) current->velocity[p] += gain[i * D + p] * innovation[i];
        for (int q = 0; q < D; q++) {
            kept[p][q] = p == q;
            for (int i = 0; i < M; i++) kept[p][q] -= gain[i * D + p] * slope[i * D + q];
        }
    }
    gbt_congruent(&kept[0][0], &spread[0][0], D, &current->spread[0][0]);
    for (int p = 0; p < D; p++)
        for (int q = 0; q < D; q++)
            for (int i = 0; i < M; i++)
                for (int k = 0; k < M; k++)
                    current->spread[p][q] += gain[i * D + p] * noise[i * M + k] * gain[k * D + q];
}

void gbt_current_learn(gbt_current *current, const gbt_own_state *latest)
{
    const gbt_own_state before = current->before;
    const int learnt = current->learnt;
    if (learnt && latest->time - before.time < gbt_pilot_numbers.period / 2) return;
    current->before = *latest;
    current->learnt = 1;
    if (learnt && current->commands > 0 && current->command[0].time <= before.time) observe(current, &before, latest);
    while (current->commands > 1 && current->command[1].time <= latest->time) forget_first(current);
}
#endif
