#include "gbt_gp.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define R GBT_ROWS_OF_WINDOW
#define SMALLEST_NUGGET ((gbt_real)1e-17)
#define LARGEST_NUGGET ((gbt_real)1e-2)

size_t gbt_gp_bytes(void) { return sizeof(gbt_gp); }

/* A track that has seen no bearing. */
static void begin(gbt_gp *process, const gbt_gp_settings *settings, int known, const gbt_real *start)
{
    process->count = 0;
    process->known = known;
    process->begun = 0;
    process->known_time = 0;
    for (int k = 0; k < D; k++) {
        process->start[k] = start[k];
        process->centre[k] = known ? settings->known_mean[k] : settings->on_vehicle ? start[k] : 0;
    }
    for (int p = 0; p < GBT_TUNABLE; p++) process->log_theta[p] = settings->tuning.first[p];
}

void gbt_gp_begin(gbt_gp *process, const gbt_gp_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&process->gaps, 0, GBT_WINDOW);
    begin(process, settings, settings->known, start);
}

/* Whether the first bearing, to which the known position belongs, is still in the window. */
static int known_in_window(const gbt_gp *process)
{
    return process->known && (!process->begun || process->time[0] <= process->known_time);
}

/* Rows of the window, with those of the known position while its time is in it. */
static void rows_of(const gbt_gp *process, const gbt_gp_settings *settings, gbt_gp_rows *rows)
{
    int r = 0;
    for (int k = 0; k < process->count; k++) {
        gbt_real basis[GBT_AXES][D];
        gbt_tangent_basis(process->bearing[k], basis);
        for (int a = 0; a < GBT_AXES; a++, r++) {
            rows->time[r] = process->time[k];
            rows->variance[r] = 0;
            for (int j = 0; j < D; j++) rows->direction[r][j] = basis[a][j];
            rows->value[r] = gbt_dot(basis[a], process->own[k]) - gbt_dot(basis[a], process->centre);
        }
    }
    rows->noisy = known_in_window(process);
    for (int a = 0; rows->noisy && a < D; a++, r++) {
        rows->time[r] = process->known_time;
        rows->variance[r] = settings->known_variance[a];
        for (int j = 0; j < D; j++) rows->direction[r][j] = settings->known_axis[a][j];
        rows->value[r] = gbt_dot(settings->known_axis[a], settings->known_mean) -
                         gbt_dot(settings->known_axis[a], process->centre);
    }
    rows->rows = r;
}

int gbt_gp_add(gbt_gp *process, const gbt_gp_settings *settings, double time, const gbt_real *bearing, const gbt_real *own)
{
    gbt_gp_rows rows;
    if (!isfinite(time)) return 0;
    for (int k = 0; k < D; k++)
        if (!isfinite(bearing[k]) || !isfinite(own[k])) return 0;
    if (process->count > 0 && !(time > process->time[process->count - 1])) return 0;
    if (gbt_gap_ended(&process->gaps, time)) begin(process, settings, 0, own);
    for (int i = 1; process->count == GBT_WINDOW && i < GBT_WINDOW; i++) {
        process->time[i - 1] = process->time[i];
        for (int k = 0; k < D; k++) {
            process->bearing[i - 1][k] = process->bearing[i][k];
            process->own[i - 1][k] = process->own[i][k];
        }
    }
    if (process->count == GBT_WINDOW) process->count--;
    process->time[process->count] = time;
    for (int k = 0; k < D; k++) {
        process->bearing[process->count][k] = bearing[k];
        process->own[process->count][k] = own[k];
    }
    process->count++;
    if (!process->begun) process->known_time = time;
    process->begun = 1;
    for (int k = 0; k < D; k++)
        process->centre[k] = known_in_window(process) ? settings->known_mean[k] : settings->on_vehicle ? own[k] : 0;
    rows_of(process, settings, &rows);
    gbt_gp_tune(&settings->tuning, &rows, process->log_theta);
    return 1;
}

/* The factor of the covariance of the rows, with the nugget multiplied by ten as often as that needs; 0 if no nugget
   helps. */
static int conditioned(const gbt_gp *process, const gbt_gp_settings *settings, const gbt_gp_rows *rows,
                       gbt_real factor[R][R])
{
    gbt_real nugget = GBT_TUNED_NUGGET ? gbt_exp(process->log_theta[GBT_TUNABLE - 1]) : settings->tuning.nugget;
    for (;;) {
        gbt_gp_covariance(rows, process->log_theta, nugget, factor);
        if (gbt_factor(&factor[0][0], rows->rows, R)) return 1;
        if (!(nugget < LARGEST_NUGGET)) return 0;
        nugget = gbt_fmin(10 * gbt_fmax(nugget, SMALLEST_NUGGET), LARGEST_NUGGET);
    }
}

void gbt_gp_predict(const gbt_gp *process, const gbt_gp_settings *settings, double time, double period, int count,
                    gbt_real *mean, gbt_real *covariance)
{
    gbt_gp_rows rows;
    gbt_real factor[R][R], values[R], cross[R][D];
    const gbt_real variance = gbt_exp(2 * process->log_theta[GBT_SHAPES]);
    rows_of(process, settings, &rows);
    const int n = rows.rows, sound = conditioned(process, settings, &rows, factor);
    for (int i = 0; i < n; i++) {
        values[i] = rows.value[i];
        for (int k = 0; k < i; k++) values[i] -= factor[i][k] * values[k];
        values[i] /= factor[i][i];
    }
    for (int t = 0; t < count; t++) {
        const double when = time + period * t;
        for (int i = 0; i < n; i++) {
            const gbt_real k = variance * gbt_gp_kernel((gbt_real)(rows.time[i] - when), process->log_theta, 0);
            for (int a = 0; a < D; a++) {
                cross[i][a] = k * rows.direction[i][a];
                for (int j = 0; j < i; j++) cross[i][a] -= factor[i][j] * cross[j][a];
                cross[i][a] /= factor[i][i];
            }
        }
        for (int a = 0; a < D; a++) {
            gbt_real sum = process->centre[a];
            for (int i = 0; i < n; i++) sum += cross[i][a] * values[i];
            mean[t * D + a] = sound ? sum : (gbt_real)NAN;
            for (int b = 0; b < D; b++) {
                gbt_real rest = a == b ? variance : 0;
                for (int i = 0; i < n; i++) rest -= cross[i][a] * cross[i][b];
                covariance[(t * D + a) * D + b] = rest;
            }
        }
    }
}
