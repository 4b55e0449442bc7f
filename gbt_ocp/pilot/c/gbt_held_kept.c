#include "gbt_held_kept.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define AHEAD_MOST 40             /* components that are carried ahead */
#define FORGOTTEN ((gbt_real)1e-6) /* weight below which a component is dropped */

/* A component by its number: those that are kept, then those that draw again. */
gbt_component *gbt_held_at(gbt_held_turn *tracker, gbt_held_turn_work *work, int slot)
{
    return slot < GBT_COMPONENTS ? &tracker->component[slot] : &work->room.again[slot - GBT_COMPONENTS];
}

/* Probabilities of so many components, from slot 0 on and from GBT_COMPONENTS on. */
void gbt_held_weigh(gbt_held_turn *tracker, gbt_held_turn_work *work, int again)
{
    const int rest = GBT_COMPONENTS - tracker->count;
    gbt_real top = -GBT_INFINITY, total = 0;
    for (int k = 0; k < tracker->count + again; k++)
        top = gbt_fmax(top, gbt_held_at(tracker, work, k < tracker->count ? k : k + rest)->log_weight);
    for (int k = 0; k < tracker->count + again; k++) {
        const int slot = k < tracker->count ? k : k + rest;
        gbt_component *one = gbt_held_at(tracker, work, slot);
        one->log_weight -= top; /* they say only how one compares with another */
        total += work->weight[slot] = gbt_exp(one->log_weight);
    }
    for (int k = 0; k < tracker->count + again; k++) work->weight[k < tracker->count ? k : k + rest] /= total;
}

/* Whether one slot comes before another: by weight, and of equal ones by number. */
static int comes_first(const gbt_held_turn_work *work, int one, int other)
{
    return one < other ? work->weight[one] >= work->weight[other] : work->weight[one] > work->weight[other];
}

/* Keeps the likeliest components, at most so many, with more than a least weight, in the order of their weights. */
void gbt_held_keep_likeliest(gbt_held_turn *tracker, gbt_held_turn_work *work, int again, int most, gbt_real least)
{
    static const int gaps[] = {701, 301, 132, 57, 23, 10, 4, 1}; /* of Shell's sort (Ciura 2001) */
    const int all = tracker->count + again;
    int some = 0;
    for (int k = 0; k < all; k++) {
        const int slot = k < tracker->count ? k : k - tracker->count + GBT_COMPONENTS;
        if (work->weight[slot] > least) work->list.judged.order[some++] = (short)slot;
    }
    for (int g = 0; g < (int)(sizeof gaps / sizeof *gaps); g++)
        for (int k = gaps[g]; k < some; k++) {
            const short one = work->list.judged.order[k];
            int place = k;
            for (; place >= gaps[g] && comes_first(work, one, work->list.judged.order[place - gaps[g]]); place -= gaps[g])
                work->list.judged.order[place] = work->list.judged.order[place - gaps[g]];
            work->list.judged.order[place] = one;
        }
    tracker->count = some < most ? some : most;
    for (int k = 0; k < tracker->count; k++) {
        int slot = work->list.judged.order[k];
        while (slot < k) slot = work->list.judged.order[slot]; /* it has changed places with one that stands there by now */
        if (slot == k) continue;
        gbt_component *here = &tracker->component[k], *there = gbt_held_at(tracker, work, slot);
        const gbt_component kept = *here;
        const gbt_real weight = work->weight[k];
        *here = *there;
        *there = kept;
        work->weight[k] = work->weight[slot];
        work->weight[slot] = weight;
    }
}

/* Whether components are reported at the median range: where the deviation of the log range, of which the sum of weights, the
   weighed mean and the weighed mean square are given, is large. */
int gbt_held_at_median(gbt_real total, gbt_real mean, gbt_real square)
{
    return gbt_sqrt(gbt_fmax(square / total - mean / total * (mean / total), 0)) > GBT_RANGE_OBSERVABLE;
}

/* Whether those that are kept, with the weights in the workspace, are. */
static int wide(const gbt_held_turn *tracker, const gbt_held_turn_work *work)
{
    const gbt_real near = tracker->component[0].mean[GBT_AT_LOG_RANGE];
    gbt_real total = 0, mean = 0, square = 0;
    for (int k = 0; k < tracker->count; k++) {
        const gbt_component *one = &tracker->component[k];
        const gbt_real weight = work->weight[k], off = one->mean[GBT_AT_LOG_RANGE] - near;
        total += weight;
        mean += weight * off;
        square += weight * (one->covariance[GBT_HELD_AT(GBT_AT_LOG_RANGE, GBT_AT_LOG_RANGE)] + off * off);
    }
    return gbt_held_at_median(total, mean, square);
}

/* Whether the components that are kept tell the range to a quarter. */
int gbt_held_observable(const gbt_held_turn *tracker, const gbt_held_turn_work *work)
{
    gbt_real mean[D], covariance[D * D], slopes[D][D];
    gbt_mixed mixed;
    gbt_mixed_begin(&mixed, wide(tracker, work));
    for (int k = 0; k < tracker->count; k++) {
        const gbt_component *one = &tracker->component[k];
        gbt_bank_position(one, mean, slopes);
        gbt_bank_spread(one, slopes, covariance);
        gbt_mixed_add(&mixed, work->weight[k], mean, covariance);
    }
    gbt_mixed_moments(&mixed, mean, covariance);
    return gbt_relative_range_std(mean, covariance, D) < GBT_RANGE_OBSERVABLE;
}

/* What is known of now and ahead, of the components that are kept. */
void gbt_held_look_ahead(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work)
{
    const int most = tracker->count < AHEAD_MOST ? tracker->count : AHEAD_MOST;
    const int median = wide(tracker, work);
    gbt_real mean[D], covariance[D * D];
    gbt_fading_begin(&settings->prior, tracker->nodes, &work->room.look.fading);
    for (int node = 0; node < tracker->nodes; node++) gbt_mixed_begin(&work->room.look.mixed[node], median);
    for (int k = 0; k < most; k++) {
        const gbt_component *one = &tracker->component[k];
        if (!(work->weight[k] > FORGOTTEN)) break;
        gbt_ahead_begin(&work->room.look.ahead, &settings->prior, &work->room.look.fading, tracker->nodes, one, mean, covariance);
        gbt_mixed_add(&work->room.look.mixed[0], work->weight[k], mean, covariance);
        for (int node = 1; node < tracker->nodes; node++) {
            gbt_ahead_next(&work->room.look.ahead, &work->room.look.fading, one, node, mean, covariance);
            gbt_mixed_add(&work->room.look.mixed[node], work->weight[k], mean, covariance);
        }
    }
    for (int node = 0; node < tracker->nodes; node++)
        gbt_mixed_moments(&work->room.look.mixed[node], tracker->mean[node], tracker->covariance[node][0]);
}
