#include "gbt_gp.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define R GBT_ROWS_OF_WINDOW
#define ROW GBT_ROW_BEGIN
#define SMALLEST_NUGGET ((gbt_real)1e-17)
#define LARGEST_NUGGET ((gbt_real)1e-2)

size_t gbt_gp_bytes(void) { return sizeof(gbt_gp); }
size_t gbt_gp_work_bytes(void) { return sizeof(gbt_gp_work); }

/* A track that has seen no bearing. */
static void begin(gbt_gp *process, const gbt_gp_settings *settings, int known, const gbt_real *start)
{
    process->count = 0;
    process->known = known;
    process->begun = 0;
    process->known_time = 0;
    for (int k = 0; k < D; k++) {
        process->start[k] = start[k];
        process->known_mean[k] = process->zero[k] + settings->known_mean[k];
        process->centre[k] = known ? process->known_mean[k] : settings->on_vehicle ? start[k] : process->zero[k];
        process->known_variance[k] = settings->known_variance[k];
        for (int j = 0; j < D; j++) process->known_axis[k][j] = settings->known_axis[k][j];
    }
#if GBT_BREAKS
    gbt_breaks_begin(&process->breaks);
#endif
    for (int p = 0; p < GBT_TUNABLE; p++) process->log_theta[p] = settings->tuning.first[p];
}

void gbt_gp_begin(gbt_gp *process, const gbt_gp_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&process->gaps, 0, GBT_WINDOW);
    for (int k = 0; k < D; k++) process->zero[k] = 0;
    begin(process, settings, settings->known, start);
}

void gbt_gp_shift(gbt_gp *process, const gbt_real *way)
{
    for (int j = 0; j < D; j++) {
        for (int k = 0; k < process->count; k++) process->window[k].own[j] -= way[j];
#if GBT_BREAKS
        process->suspect.own[j] -= way[j];
#endif
        process->zero[j] -= way[j];
        process->known_mean[j] -= way[j];
        process->start[j] -= way[j];
        process->centre[j] -= way[j];
    }
}

/* Whether the bearing to which the known position belongs is still in the window. */
static int known_in_window(const gbt_gp *process)
{
    return process->known && (!process->begun || process->window[0].time <= process->known_time);
}

/* Rows of the window, with those of the known position while its time is in it. */
static void rows_of(const gbt_gp *process, gbt_gp_rows *rows)
{
    int r = 0;
    rows->zero = process->count > 0 ? process->window[0].time : process->known_time;
    for (int k = 0; k < process->count; k++) {
        const gbt_sample *sample = &process->window[k];
        gbt_real basis[GBT_AXES][D], own[D];
        for (int j = 0; j < D; j++) own[j] = sample->own[j] - process->centre[j];
        gbt_tangent_basis(sample->bearing, basis);
        for (int a = 0; a < GBT_AXES; a++, r++) {
            rows->time[r] = gbt_widen_double(sample->time - rows->zero);
            rows->variance[r] = 0;
            for (int j = 0; j < D; j++) rows->direction[r][j] = basis[a][j];
            rows->value[r] = gbt_dot(basis[a], own);
        }
    }
    rows->noisy = known_in_window(process);
    for (int a = 0; rows->noisy && a < D; a++, r++) {
        rows->time[r] = gbt_widen_double(process->known_time - rows->zero);
        rows->variance[r] = process->known_variance[a];
        for (int j = 0; j < D; j++) rows->direction[r][j] = process->known_axis[a][j];
        rows->value[r] = 0;
        for (int j = 0; j < D; j++)
            rows->value[r] += process->known_axis[a][j] * (process->known_mean[j] - process->centre[j]);
    }
    rows->rows = r;
}

/* The factor of the covariance of the rows, with the nugget multiplied by ten as often as that needs; 0 if no nugget
   helps. */
static int factored(const gbt_gp *process, gbt_gp_posterior *of)
{
    for (;; of->raised++) {
        gbt_gp_covariance(&of->rows, process->log_theta, of->nugget, of->by.factor.lower, 0);
        if (gbt_factor(of->by.factor.lower, of->rows.rows)) return 1;
        if (!(of->nugget < LARGEST_NUGGET)) return 0;
        of->nugget = gbt_fmin(10 * gbt_fmax(of->nugget, SMALLEST_NUGGET), LARGEST_NUGGET);
    }
}

static void condition(const gbt_gp *process, const gbt_gp_settings *settings, gbt_gp_posterior *of)
{
    rows_of(process, &of->rows);
    of->variance = gbt_exp(2 * process->log_theta[GBT_SHAPES]);
    of->nugget = GBT_TUNED_NUGGET ? gbt_exp(process->log_theta[GBT_TUNABLE - 1]) : settings->tuning.nugget;
    of->raised = of->rooted = 0;
#if GBT_ROOTED
    of->rooted = of->sound = gbt_gp_root_condition(&of->by.root, &of->rows, process->log_theta,
                                                   gbt_exp(settings->tuning.low[GBT_TUNABLE - 1]));
#endif
    if (of->rooted) return;
    of->sound = factored(process, of);
    gbt_gp_whiten(&of->rows, of->by.factor.lower, of->by.factor.values);
}

/* The mean and the covariance at a time. */
static void predict(const gbt_gp *process, const gbt_gp_posterior *of, double time, gbt_real *mean, gbt_real *covariance)
{
    gbt_wide cross[D][R];
    const int n = of->rows.rows;
#if GBT_ROOTED
    if (of->rooted) {
        gbt_gp_root_predict(&of->by.root, time - of->rows.zero, mean, covariance);
        for (int a = 0; a < D; a++) mean[a] += process->centre[a];
        return;
    }
#endif
    const gbt_gp_shape shape = gbt_gp_shape_of(process->log_theta);
    const gbt_wide now = gbt_widen_double(time - of->rows.zero);
    for (int i = 0; i < n; i++) {
        const gbt_wide lag = gbt_plus(of->rows.time[i], gbt_negative(now));
        const gbt_wide k = gbt_times(gbt_widen(of->variance), gbt_gp_kernel(lag, &shape, 0));
        for (int a = 0; a < D; a++) {
            const gbt_wide *row = of->by.factor.lower + ROW(i);
            gbt_wide rest = gbt_times(k, gbt_widen(of->rows.direction[i][a]));
            for (int j = 0; j < i; j++) rest = gbt_gather_less(rest, row[j], cross[a][j]);
            cross[a][i] = gbt_times(gbt_gathered(rest), row[i]);
        }
    }
    for (int a = 0; a < D; a++) {
        gbt_wide sum = gbt_widen(process->centre[a]);
        for (int i = 0; i < n; i++) sum = gbt_gather(sum, cross[a][i], of->by.factor.values[i]);
        mean[a] = of->sound ? gbt_narrow(gbt_gathered(sum)) : (gbt_real)NAN;
        for (int b = 0; b <= a; b++) {
            gbt_wide rest = gbt_widen(a == b ? of->variance : 0);
            for (int i = 0; i < n; i++) rest = gbt_gather_less(rest, cross[a][i], cross[b][i]);
            covariance[a * D + b] = covariance[b * D + a] = gbt_narrow(gbt_gathered(rest));
        }
    }
}

int gbt_gp_predict(const gbt_gp *process, const gbt_gp_settings *settings, gbt_gp_work *work, const double *times, int count,
                   gbt_real *mean, gbt_real *covariance)
{
    gbt_gp_posterior *now = &work->posterior;
    condition(process, settings, now);
    for (int t = 0; t < count; t++) predict(process, now, times[t], &mean[t * D], &covariance[t * D * D]);
    return now->raised;
}

#if GBT_BREAKS
/* Keeps the latest bearing, the first after a break, and where the target was then. */
static void cut(gbt_gp *process, const gbt_gp_settings *settings, const gbt_real *mean, gbt_real deviation)
{
    process->window[0] = process->suspect;
    process->count = 1;
    process->known = 1;
    process->known_time = process->suspect.time;
    for (int k = 0; k < D; k++) {
        process->known_mean[k] = mean[k];
        process->known_variance[k] = deviation * deviation;
        for (int j = 0; j < D; j++) process->known_axis[k][j] = j == k;
    }
    for (int p = 0; p < GBT_TUNABLE; p++) process->log_theta[p] = settings->tuning.first[p];
}

/* Judges a bearing before it is taken in. */
static gbt_gp_taken judge(gbt_gp *process, const gbt_gp_settings *settings, gbt_gp_posterior *before,
                          const gbt_sample *sample)
{
    gbt_real mean[D], covariance[D * D], deviation = 0;
    condition(process, settings, before);
    predict(process, before, sample->time, mean, covariance);
    const gbt_real elapsed = process->breaks.suspects ? (gbt_real)(sample->time - process->suspect.time) : 0;
    if (gbt_breaks_judge(&process->breaks, mean, covariance, before->variance * before->nugget, sample->bearing, sample->own,
                         elapsed, &deviation)) {
        predict(process, before, process->suspect.time, mean, covariance);
        cut(process, settings, mean, deviation);
        return GBT_GP_BROKEN;
    }
    if (!process->breaks.suspects) return GBT_GP_TAKEN;
    process->suspect = *sample;
    return GBT_GP_WAITS;
}
#endif

/* Whether a sample is finite and after the last one. */
static int sound_sample(const gbt_gp *process, const gbt_sample *sample)
{
    if (!isfinite(sample->time)) return 0;
    for (int k = 0; k < D; k++)
        if (!isfinite(sample->bearing[k]) || !isfinite(sample->own[k])) return 0;
#if GBT_BREAKS
    if (process->breaks.suspects && !(sample->time > process->suspect.time)) return 0;
#endif
    return process->count == 0 || sample->time > process->window[process->count - 1].time;
}

gbt_gp_taken gbt_gp_add(gbt_gp *process, const gbt_gp_settings *settings, gbt_gp_work *work, double time,
                        const gbt_real *bearing, const gbt_real *own)
{
    gbt_gp_taken taken = GBT_GP_TAKEN;
    gbt_gp_rows rows;
    gbt_sample sample;
    sample.time = time;
    for (int k = 0; k < D; k++) {
        sample.bearing[k] = bearing[k];
        sample.own[k] = own[k];
    }
    if (!sound_sample(process, &sample)) return GBT_GP_REFUSED;
    if (gbt_gap_ended(&process->gaps, time)) begin(process, settings, 0, own);
#if GBT_BREAKS
    else if (process->begun) taken = judge(process, settings, &work->posterior, &sample);
    if (taken == GBT_GP_WAITS) return taken;
#endif
    for (int i = 1; process->count == GBT_WINDOW && i < GBT_WINDOW; i++) process->window[i - 1] = process->window[i];
    if (process->count == GBT_WINDOW) process->count--;
    process->window[process->count++] = sample;
    if (!process->begun) process->known_time = time;
    process->begun = 1;
    for (int k = 0; k < D; k++)
        process->centre[k] = known_in_window(process) ? process->known_mean[k] : settings->on_vehicle ? own[k] : process->zero[k];
    rows_of(process, &rows);
    gbt_gp_tune(&settings->tuning, &rows, &work->tuning, process->log_theta);
    return taken;
}
