#include "gbt_motion_gp.h"

#include "gbt_math.h"
#include "gbt_mixed.h"
#include "gbt_nodes.h"
#include "gbt_noise.h"
#include "gbt_shape_hypotheses.h"

#define D GBT_DIMENSION
#define T GBT_POINTS
#define ON_TIME 1e-9                      /* rounding of a time, s */
#define LOST_RESIDUAL ((gbt_real)6)       /* mean squared residual of the latest bins above which a track counts as lost, */
#define UNFIT 3                           /* and estimates in a row of which that is so */
#define FORGOTTEN 0.6                     /* share of the window that is then forgotten */
#define EVERY 5                           /* estimates between two competitions where it is clear where the target is */

size_t gbt_motion_gp_bytes(void) { return sizeof(gbt_motion_gp); }
size_t gbt_motion_gp_work_bytes(void) { return sizeof(gbt_motion_gp_work); }

/* A track that has seen no bearing. */
static void begin(gbt_motion_gp *process, int known, const gbt_real *start)
{
    gbt_bins_clear(&process->bins);
    process->others.count = process->memory.count = 0;
    process->known = known;
    process->seen = process->found = process->hypotheses = process->likely = 0;
    process->estimates = process->unfit = 0;
    process->open = 1;
    process->now = process->first = 0;
    process->log_evidence = 0;
    process->relative_range_std = GBT_INFINITY;
    for (int k = 0; k < D; k++) process->own[k] = start[k];
}

void gbt_motion_gp_begin(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&process->gaps, settings->binning.window, 0);
    process->bins.latest = process->bearing_at = -HUGE_VAL;
    process->restarts = 0;
    for (int k = 0; k < D; k++) process->zero[k] = 0;
    begin(process, settings->known, start);
}

void gbt_motion_gp_shift(gbt_motion_gp *process, const gbt_real *way)
{
    gbt_bins_shift(&process->bins, way);
    for (int j = 0; j < D; j++) {
        process->zero[j] -= way[j];
        process->own[j] -= way[j];
        for (int k = 0; k < process->others.count; k++) process->others.single[k].sighting.position[j] -= way[j];
        for (int k = 0; k < 2 * process->memory.count; k++) process->memory.kept[k / 2].position[k % 2][j] -= way[j];
    }
}

/* ---- estimates ---- */

/* What is known from before the window: what is remembered, or the position at the first bearing; 0 if nothing is. */
static int known_before(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, double now, gbt_known *known)
{
    const gbt_binning *binning = &settings->binning;
    const double begins = gbt_bins_begin(&process->bins, binning), between = settings->prior.knot / GBT_KNOT_NODES;
    if (gbt_memory_recall(&process->memory, begins, now, settings->prior.span, between, known)) return 1;
    if (!process->known || process->bins.bin[0].time > process->first + binning->width) return 0;
    known->count = 1;
    known->time[0] = process->first;
    for (int j = 0; j < D; j++) known->position[0][j] = process->zero[j] + settings->known_mean[j];
    return gbt_precision_root(settings->known_covariance[0], D, 1, known->root);
}

static void see(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work, double now,
                const gbt_real *own)
{
    gbt_known known;
    const int some = known_before(process, settings, now, &known);
    gbt_see(&settings->prior, &settings->noise, &process->bins, gbt_white_variance(settings->noise.std, settings->estimated, &process->bins), &process->others,
            some ? &known : 0, now, own, &work->seen);
}

/* Estimates from what is in the window; returns whether the track is lost and has to begin again. */
static int estimate(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work, double now,
                    const gbt_real *own)
{
    int hypotheses = process->found ? process->hypotheses : 0, best = 0;
    gbt_real moved[D];
    for (int k = 0; k < D; k++) moved[k] = own[k] - process->own[k];
    see(process, settings, work, now, own);
    for (int k = 0; k < hypotheses * T; k++)
        gbt_motion_advance(&settings->prior, &process->motion[k], now - process->now, moved, &work->fitted[k].at);
    process->now = now;
    for (int k = 0; k < D; k++) process->own[k] = own[k];
    gbt_shape_fit(&settings->prior, &settings->noise, &work->seen, work->fitted, hypotheses * T, settings->iterations,
                  &work->walk, &work->normal);
    process->estimates++;
    /* at every estimate while it is open where the target is, now and then afterwards */
    if (hypotheses == 0 || process->unfit || process->estimates % EVERY == 0 || process->open)
        hypotheses = gbt_hypotheses_compete(settings, work, hypotheses);
    process->hypotheses = gbt_hypotheses_distinct(settings, work, hypotheses);
    process->found = process->hypotheses > 0;
    if (!process->found) return 0;
    gbt_hypotheses_moments(process, settings, work);
    for (int k = 0; k < process->hypotheses * T; k++) {
        gbt_motion_move(&work->fitted[k].at, work->fitted[k].step, &process->motion[k]);
        if (work->fitted[k].log_evidence > work->fitted[best].log_evidence) best = k;
    }
    process->relative_range_std = gbt_relative_range_std(process->position[0], process->covariance[0], GBT_BOTH);
    process->open = !(process->relative_range_std < GBT_RANGE_OBSERVABLE);
    if (!process->open && isfinite(settings->memory)) {
        gbt_real position[2][D];
        for (int k = 0; k < 2 * D; k++) position[k / D][k % D] = own[k % D] + process->position[k / D][k % D];
        gbt_memory_keep(&process->memory, now, position, process->covariance[0], settings->memory);
    }
    /* bearings that no motion of the prior explains mean that the track is lost */
    process->unfit = work->fitted[best].recent > LOST_RESIDUAL ? process->unfit + 1 : 0;
    return process->unfit >= UNFIT;
}

static void estimate_again(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work,
                           double now, const gbt_real *own)
{
    if (!estimate(process, settings, work, now, own)) return;
    process->restarts++;
    process->unfit = process->found = process->memory.count = 0;
    gbt_bins_forget(&process->bins, &settings->binning, now - (1 - FORGOTTEN) * settings->binning.window);
    estimate(process, settings, work, now, own);
}

/* ---- measurements ---- */

/* The direction in which the target is expected, and whether a bearing lies beyond the gate from it; 0 if it is not known. */
static int gated(const gbt_motion_gp *process, const gbt_motion_gp_settings *settings, double time,
                 const gbt_real *bearing, const gbt_real *own, gbt_real weight, gbt_real *unit, int *suspect)
{
    const gbt_shape_noise *noise = &settings->noise;
    gbt_real mean[D], covariance[D * D], basis[GBT_AXES][D], angle[GBT_AXES], found[GBT_AXES];
    gbt_real spread[GBT_AXES * GBT_AXES], square = 0;
    *suspect = 0;
    if (!process->found || !isfinite(settings->gate)) return 0;
    gbt_motion_gp_predict(process, settings, time, mean, covariance);
    for (int k = 0; k < D; k++) unit[k] = mean[k] - own[k];
    const gbt_real distance = gbt_length(unit);
    if (!(distance > 0)) return 0;
    for (int k = 0; k < D; k++) unit[k] /= distance;
    gbt_tangent_basis(unit, basis);
    gbt_log_map(unit, bearing, basis, angle);
    const gbt_real off = noise->own_std / distance;
    gbt_across(basis, covariance, spread);
    for (int a = 0; a < GBT_AXES; a++) {
        found[a] = angle[a];
        for (int b = 0; b < GBT_AXES; b++) spread[a * GBT_AXES + b] /= distance * distance;
        spread[a * (GBT_AXES + 1)] += noise->std * noise->std / weight + noise->correlated_std * noise->correlated_std + off * off;
    }
    if (!gbt_solve_square(spread, GBT_AXES, found, 1)) return 0;
    for (int a = 0; a < GBT_AXES; a++) square += angle[a] * found[a];
    *suspect = square > settings->gate * settings->gate;
    return 1;
}

/* Takes a bearing that is worth so many of the configured noise, and what came with it. */
static void see_bearing(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work,
                        double time, const gbt_sighting_parts *parts, const gbt_real *own)
{
    const gbt_real ratio = parts->std > 0 ? settings->noise.std / parts->std : 1;
    gbt_real ahead[D];
    int suspect;
    if (gbt_gap_ended(&process->gaps, time)) begin(process, 0, own);
    if (parts->single) gbt_singles_add(&process->others, settings->binning.width, &parts->rest);
    const int expected = gated(process, settings, time, parts->unit, own, ratio * ratio, ahead, &suspect);
    gbt_bins_add(&process->bins, &settings->binning, time, parts->unit, own, expected ? ahead : 0, suspect, ratio * ratio);
    gbt_singles_forget(&process->others, gbt_bins_begin(&process->bins, &settings->binning));
    process->bearing_at = time;
    if (!process->seen) process->first = time;
    process->seen = 1;
    if (!process->found || time - process->now >= settings->update - ON_TIME)
        estimate_again(process, settings, work, time, own);
}

int gbt_motion_gp_take(gbt_motion_gp *process, const gbt_motion_gp_settings *settings, gbt_motion_gp_work *work,
                       const gbt_sighting *sighting)
{
    gbt_sighting_parts parts;
    const int plain = gbt_is_bearing(sighting) && !sighting->stated;
    const double others = gbt_singles_latest(&process->others), latest = fmax(process->bins.latest, others);
    if (!gbt_can_take(sighting, 1, plain ? process->bins.latest : latest)) return 0;
    if (plain && !(sighting->time > process->bins.latest)) return 0;
    if (!isfinite(sighting->time)) return 0;
    gbt_parts_of(sighting, settings->noise.std, &parts);
    if (parts.bearing) {
        if (gbt_bins_full(&process->bins, &settings->binning, sighting->time)) return 0;
        see_bearing(process, settings, work, sighting->time, &parts, sighting->position);
        return 1;
    }
    gbt_singles_add(&process->others, settings->binning.width, &parts.rest);
    if (process->found && sighting->time - process->now >= settings->update - ON_TIME)
        estimate_again(process, settings, work, sighting->time, sighting->position);
    return 1;
}

/* ---- forecasts ---- */

/* Between two values in units of nodes. */
static gbt_real between(gbt_real first, gbt_real last, gbt_real share) { return (1 - share) * first + share * last; }

/* Moments of a hypothesis, or of the mixture of all of them, at a node ahead. */
static void node_moments(const gbt_motion_gp *process, int hypothesis, int node, gbt_real *mean, gbt_real *covariance)
{
    for (int i = 0; i < D; i++) {
        mean[i] = 0;
        for (int h = 0; h < process->likely; h++) {
            const gbt_real weight = hypothesis < 0 ? process->hypothesis[h].weight : (gbt_real)(h == hypothesis);
            mean[i] += weight * process->hypothesis[h].mean[node][i];
        }
    }
    for (int i = 0; i < D; i++)
        for (int j = 0; j < D; j++) {
            covariance[i * D + j] = 0;
            for (int h = 0; h < process->likely; h++) {
                const gbt_hypothesis *one = &process->hypothesis[h];
                const gbt_real weight = hypothesis < 0 ? one->weight : (gbt_real)(h == hypothesis);
                const gbt_real apart = (one->mean[node][i] - mean[i]) * (one->mean[node][j] - mean[j]);
                covariance[i * D + j] += weight * (one->covariance[node][i][j] + apart);
            }
        }
}

/* Ahead of now, linear between the nodes. Beyond the last one the mean goes straight on, and the covariance grows with the
   cube of the time. */
static void ahead_at(const gbt_motion_gp *process, const gbt_motion_gp_settings *settings, int hypothesis, double lag,
                     gbt_real *mean, gbt_real *covariance)
{
    const double step = settings->prior.knot / GBT_KNOT_NODES;
    gbt_real next[D], spread[D * D], share;
    const int node = gbt_node_before(lag, step, GBT_NODES_AHEAD, &share);
    node_moments(process, hypothesis, node, mean, covariance);
    node_moments(process, hypothesis, node + 1, next, spread);
    gbt_between_nodes(lag, step, GBT_NODES_AHEAD, mean, covariance, next, spread);
}

void gbt_motion_gp_predict(const gbt_motion_gp *process, const gbt_motion_gp_settings *settings, double time,
                           gbt_real *mean, gbt_real *covariance)
{
    const gbt_shape_prior *prior = &settings->prior;
    if (!process->found) {
        const gbt_real wide = prior->range * prior->range * gbt_exp(2 * prior->log_range_std * prior->log_range_std) / D;
        for (int i = 0; i < D; i++) {
            mean[i] = process->known ? process->zero[i] + settings->known_mean[i] : process->own[i];
            for (int j = 0; j < D; j++)
                covariance[i * D + j] = process->known ? settings->known_covariance[i][j] : i == j ? wide : 0;
        }
        return;
    }
    const double lag = time - process->now;
    if (lag >= 0) {
        ahead_at(process, settings, -1, lag, mean, covariance);
    } else {
        const gbt_real share = (gbt_real)fmin(-lag * GBT_KNOT_NODES / prior->knot, 1);
        for (int i = 0; i < D; i++) {
            mean[i] = between(process->position[0][i], process->position[1][i], share);
            for (int j = 0; j < D; j++)
                covariance[i * D + j] = between(process->covariance[i][j], process->covariance[D + i][D + j], share);
        }
    }
    for (int i = 0; i < D; i++) mean[i] += process->own[i];
}

void gbt_motion_gp_believe(const gbt_motion_gp *process, const gbt_motion_gp_settings *settings, int hypothesis,
                           double time, gbt_real *mean, gbt_real *covariance)
{
    ahead_at(process, settings, hypothesis, fmax(time - process->now, 0), mean, covariance);
    for (int i = 0; i < D; i++) mean[i] += process->own[i];
}
