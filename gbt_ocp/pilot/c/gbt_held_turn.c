#include "gbt_held_turn.h"

#include "gbt_held_correct.h"
#include "gbt_held_kept.h"
#include "gbt_math.h"
#include "gbt_nodes.h"

#define D GBT_DIMENSION
#define START_WIDTH ((gbt_real)4) /* deviations of a bearing's noise within which a track is begun about it */
#define OPEN_S 5.001 /* s after the first bearing in which no turn rate is let go, the speed of all changes in the first manner, and
                        all starts are kept; no time between bearings, of which rounding would decide whether it is longer */
#define FORGOTTEN ((gbt_real)1e-6) /* weight below which a component is dropped */

size_t gbt_held_turn_bytes(void) { return sizeof(gbt_held_turn); }
size_t gbt_held_turn_work_bytes(void) { return sizeof(gbt_held_turn_work); }

/* A track that has seen no bearing. */
static void begin(gbt_held_turn *tracker, int known, const gbt_real *start)
{
    gbt_bins_clear(&tracker->bins);
    gbt_waiting_clear(&tracker->waiting);
    tracker->known = known;
    tracker->found = tracker->count = tracker->observable = 0;
    tracker->nodes = 2;
    tracker->now = tracker->first = 0;
    tracker->lost.count = tracker->lost.next = 0;
    for (int k = 0; k < D; k++) tracker->own[k] = start[k];
}

void gbt_held_turn_begin(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, const gbt_real *start)
{
    gbt_gaps_init(&tracker->gaps, GBT_SCATTER_S, 0);
    gbt_waiting_begin(&tracker->waiting);
    tracker->bins.latest = -HUGE_VAL;
    tracker->restarts = 0;
    for (int k = 0; k < D; k++) tracker->zero[k] = 0;
    begin(tracker, settings->known, start);
}

void gbt_held_turn_shift(gbt_held_turn *tracker, const gbt_real *way)
{
    gbt_bins_shift(&tracker->bins, way);
    gbt_waiting_shift(&tracker->waiting, way);
    for (int k = 0; k < D; k++) {
        tracker->own[k] -= way[k];
        tracker->zero[k] -= way[k];
    }
}

/* ---- bearings in ---- */

/* All starts about a bearing, a little wider than its noise: it counts with the rest of its bin. */
static void start(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, double time,
                  const gbt_real *bearing, const gbt_real *own)
{
    const gbt_bearing_noise *noise = &settings->noise;
    const gbt_real white = noise->std * noise->std + noise->correlated_std * noise->correlated_std;
    const int *starts = settings->starts;
    gbt_real angles[GBT_AXES], position[D];
    gbt_angles_of(bearing, angles);
    tracker->found = 1;
    tracker->count = starts[0] * starts[1] * starts[2] * GBT_TURN_STDS;
    tracker->now = tracker->first = time;
    for (int j = 0; j < D; j++) {
        tracker->own[j] = own[j];
        position[j] = tracker->zero[j] + settings->known_mean[j] - own[j];
    }
    for (int k = 0; k < tracker->count; k++) {
        gbt_component *one = &tracker->component[k];
        gbt_bank_start(&settings->prior, angles, START_WIDTH * START_WIDTH * white, starts, k, one);
        if (tracker->known) gbt_bank_place(one, position, settings->known_covariance[0]);
    }
    gbt_held_weigh(tracker, work, 0);
    gbt_held_keep_likeliest(tracker, work, 0, tracker->count, -1);
    tracker->observable = gbt_held_observable(tracker, work);
    gbt_held_look_ahead(tracker, settings, work);
}

/* Carries the components to a time, if that is to come, with the vehicle at `own`; returns how many draw again, or begin in another
   manner. */
static int carry(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, double time,
                 const gbt_real *own)
{
    const gbt_real seconds = (gbt_real)(time - tracker->now);
    const int held = tracker->count;
    gbt_real moved[D];
    int again = 0;
    if (!(seconds > 0)) return 0;
    for (int j = 0; j < D; j++) moved[j] = own[j] - tracker->own[j];
    if (time - tracker->first > OPEN_S && tracker->now - tracker->first <= OPEN_S) {
        again = gbt_bank_other_manners(&settings->prior, tracker->component, held, work->room.again);
    } else if (time - tracker->first > OPEN_S) {
        const gbt_real share = -gbt_expm1(-seconds / settings->prior.hold);
        again = gbt_bank_draw_again(&settings->prior, tracker->component, held, share, &work->list.cells, work->room.again);
        for (int k = 0; k < held; k++) tracker->component[k].log_weight += gbt_log1p(-share);
    }
    for (int k = 0; k < held + again; k++)
        gbt_bank_advance(&settings->prior, gbt_held_at(tracker, work, k < held ? k : k - held + GBT_COMPONENTS), seconds, moved);
    return again;
}

/* Keeps the likeliest, of weighed ones; all starts for a while. */
static void keep(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, int again, double time)
{
    const int most = time - tracker->first <= OPEN_S ? GBT_COMPONENTS : settings->components;
    gbt_held_keep_likeliest(tracker, work, again, most, FORGOTTEN);
}

/* What is known, of the components that are kept. */
static void look(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work)
{
    gbt_held_weigh(tracker, work, 0);
    tracker->observable = gbt_held_observable(tracker, work);
    gbt_held_look_ahead(tracker, settings, work);
}

/* Takes in the newest bin, now that it is full. */
static void step(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work)
{
    const gbt_bin *bin = &tracker->bins.bin[tracker->bins.count - 1];
    const gbt_real white = gbt_white_variance(settings->noise.std, settings->noise.estimated, &tracker->bins);
    const int again = carry(tracker, settings, work, bin->time, bin->own), held = tracker->count;
    gbt_real angles[GBT_AXES], square = 0;
    gbt_angles_of(bin->bearing, angles);
    for (int k = 0; k < held + again; k++) {
        const int slot = k < held ? k : k - held + GBT_COMPONENTS;
        gbt_component *one = gbt_held_at(tracker, work, slot);
        const gbt_real range = gbt_exp(one->mean[GBT_AT_LOG_RANGE]);
        const gbt_real noise = gbt_noise_of_mean(&settings->noise, bin->count, settings->binning.width, range, white);
        work->list.judged.square[slot] = gbt_bank_correct(one, angles, noise);
    }
    gbt_held_weigh(tracker, work, again);
    for (int k = 0; k < held + again; k++) {
        const int slot = k < held ? k : k - held + GBT_COMPONENTS;
        square += work->weight[slot] * work->list.judged.square[slot];
    }
    const int lost = gbt_lost_after(&tracker->lost, square / GBT_AXES);
    keep(tracker, settings, work, again, bin->time);
    tracker->now = bin->time;
    for (int j = 0; j < D; j++) tracker->own[j] = bin->own[j];
    if (lost) {
        tracker->restarts++;
        tracker->lost.count = tracker->lost.next = 0;
        tracker->known = 0;
        start(tracker, settings, work, bin->time, bin->bearing, bin->own);
    } else {
        look(tracker, settings, work);
    }
}

/* Begins a new track after a gap; takes in the newest bin once that is full. */
static void note(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, double time,
                 const gbt_real *own)
{
    gbt_waiting *waiting = &tracker->waiting;
    if (gbt_gap_ended(&tracker->gaps, time)) begin(tracker, 0, own);
    waiting->latest = time;
    gbt_waiting_forget(waiting, settings->binning.width, time);
    if (!tracker->found || waiting->full || !gbt_bins_filled_by(&tracker->bins, &settings->binning, time)) return;
    step(tracker, settings, work);
    waiting->full = 1;
}

/* Takes in measurements of a time that are no bearings, from a place of the vehicle. What is in the newest bin has a mean time
   to come: the bank waits at the oldest of it. */
static void count(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, double time,
                  const gbt_real *own, const gbt_sighting *sighting, int some)
{
    const gbt_binned *oldest = &tracker->bins.sample[0];
    const double until = tracker->waiting.full ? time : oldest->time;
    const gbt_real *place = tracker->waiting.full ? own : oldest->own;
    int again = carry(tracker, settings, work, until, place);
    if (until > tracker->now) {
        tracker->now = until;
        for (int j = 0; j < D; j++) tracker->own[j] = place[j];
    }
    for (int k = 0; k < some; k++) {
        const gbt_real lag = (gbt_real)(sighting[k].time - tracker->now);
        for (int c = 0; c < tracker->count + again; c++) {
            const int slot = c < tracker->count ? c : c - tracker->count + GBT_COMPONENTS;
            gbt_bank_sight(gbt_held_at(tracker, work, slot), &sighting[k], lag, tracker->own, settings->noise.std);
        }
        gbt_held_weigh(tracker, work, again);
        keep(tracker, settings, work, again, tracker->now);
        again = 0;
    }
    look(tracker, settings, work);
}

/* Takes in a bearing that is worth so many ordinary ones. */
static void see(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, double time,
                const gbt_real *bearing, const gbt_real *own, gbt_real weight)
{
    note(tracker, settings, work, time, own);
    gbt_bins_add(&tracker->bins, &settings->binning, time, bearing, own, 0, 0, weight);
    tracker->waiting.full = 0;
    if (tracker->found) return;
    start(tracker, settings, work, time, bearing, own);
    if (tracker->waiting.count > 0)
        count(tracker, settings, work, time, own, tracker->waiting.sighting, tracker->waiting.count);
    tracker->waiting.count = 0;
}

int gbt_held_turn_update(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work,
                         double time, const gbt_real *bearing, const gbt_real *own)
{
    if (time < tracker->waiting.latest || !gbt_bins_can_add(&tracker->bins, &settings->binning, time)) return 0;
    see(tracker, settings, work, time, bearing, own, 1);
    return 1;
}

int gbt_held_turn_take(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work,
                       const gbt_sighting *sighting)
{
    const gbt_real std = settings->noise.std, *own = sighting->position;
    gbt_sighting_parts parts;
    if (!gbt_take_apart(sighting, tracker->waiting.latest, &tracker->bins, &settings->binning, std, &parts)) return 0;
    if (!gbt_waiting_room(&tracker->waiting, settings->binning.width, sighting->time)) return 0;
    if (parts.bearing)
        see(tracker, settings, work, sighting->time, parts.unit, own, gbt_worth(&parts, std));
    else
        note(tracker, settings, work, sighting->time, own);
    if (!parts.single) return 1;
    if (tracker->found)
        count(tracker, settings, work, sighting->time, own, &parts.rest, 1);
    else
        gbt_waiting_add(&tracker->waiting, &parts.rest);
    return 1;
}

/* ---- what is known ---- */

void gbt_held_turn_ask(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, double time)
{
    const double needed = ceil((time - tracker->now) / GBT_AHEAD_STEP) + 1;
    if (!tracker->found || !(needed > tracker->nodes) || tracker->nodes == GBT_HELD_NODES) return;
    tracker->nodes = needed < GBT_HELD_NODES ? (int)needed : GBT_HELD_NODES;
    gbt_held_weigh(tracker, work, 0);
    gbt_held_look_ahead(tracker, settings, work);
}

/* Before the latest full bin: the present motion led back. */
static void led_back(const gbt_held_turn *tracker, const gbt_held_turn_settings *settings, double lag, gbt_real *mean,
                     gbt_real *covariance)
{
    static const gbt_real still[D];
    const gbt_real seconds = (gbt_real)lag;
    gbt_real slopes[D][D], near = 0, total = 0, first = 0, second = 0;
    gbt_mixed mixed;
    for (int pass = 0; pass < 2; pass++) {
        if (pass > 0) gbt_mixed_begin(&mixed, gbt_held_at_median(total, first, second));
        for (int k = 0; k < tracker->count; k++) {
            gbt_component one = tracker->component[k];
            gbt_bank_advance(&settings->prior, &one, seconds, still);
            const gbt_real weight = gbt_exp(one.log_weight), log_range = one.mean[GBT_AT_LOG_RANGE];
            if (pass == 0) {
                if (k == 0) near = log_range;
                const gbt_real off = log_range - near;
                total += weight;
                first += weight * off;
                second += weight * (one.covariance[GBT_HELD_AT(GBT_AT_LOG_RANGE, GBT_AT_LOG_RANGE)] + off * off);
            } else {
                gbt_bank_position(&one, mean, slopes);
                gbt_bank_spread(&one, slopes, covariance);
                gbt_mixed_add(&mixed, weight, mean, covariance);
            }
        }
    }
    gbt_mixed_moments(&mixed, mean, covariance);
}

void gbt_held_turn_predict(const gbt_held_turn *tracker, const gbt_held_turn_settings *settings, double time,
                           gbt_real *mean, gbt_real *covariance)
{
    const gbt_held_prior *prior = &settings->prior;
    const double lag = time - tracker->now, step_s = GBT_AHEAD_STEP;
    if (!tracker->found) {
        const gbt_real spread = prior->range * prior->range * gbt_exp(2 * prior->log_range_std * prior->log_range_std) / D;
        for (int i = 0; i < D; i++) {
            mean[i] = tracker->known ? tracker->zero[i] + settings->known_mean[i] : tracker->own[i];
            for (int j = 0; j < D; j++)
                covariance[i * D + j] = tracker->known ? settings->known_covariance[i][j] : i == j ? spread : 0;
        }
        return;
    }
    if (lag >= 0) {
        gbt_real share;
        const int node = gbt_node_before(lag, step_s, tracker->nodes, &share);
        for (int i = 0; i < D; i++) {
            mean[i] = tracker->mean[node][i];
            for (int j = 0; j < D; j++) covariance[i * D + j] = tracker->covariance[node][i][j];
        }
        gbt_between_nodes(lag, step_s, tracker->nodes, mean, covariance, tracker->mean[node + 1],
                          tracker->covariance[node + 1][0]);
    } else {
        led_back(tracker, settings, lag, mean, covariance);
    }
    for (int i = 0; i < D; i++) mean[i] += tracker->own[i];
}

void gbt_held_turn_forecast(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work,
                         const double *time, int count, gbt_real *mean, gbt_real *covariance)
{
    for (int k = 0; k < count; k++) {
        gbt_held_turn_ask(tracker, settings, work, time[k]);
        gbt_held_turn_predict(tracker, settings, time[k], &mean[k * D], &covariance[k * D * D]);
    }
}
