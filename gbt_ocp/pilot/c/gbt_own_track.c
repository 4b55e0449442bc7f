#include "gbt_own_track.h"

#include "gbt_math.h"

#define D GBT_DIMENSION
#define LATE (gbt_pilot_numbers.late)
#define GAP (gbt_pilot_numbers.navigation_gap)

void gbt_earth_rates(const gbt_real *pose, const gbt_real *velocity, gbt_real *rates)
{
    const gbt_real c = gbt_cos(pose[D]), s = gbt_sin(pose[D]);
    gbt_real ahead = velocity[0];
    for (int j = 2; j < GBT_POSE; j++) rates[j] = velocity[j];
#if GBT_DIMENSION == 3 && GBT_FLAT > 4
    const gbt_real ct = gbt_cos(pose[4]), st = gbt_sin(pose[4]);
    ahead = ct * velocity[0] - st * velocity[2];
    rates[2] = st * velocity[0] + ct * velocity[2];
#endif
    rates[0] = c * ahead - s * velocity[1];
    rates[1] = s * ahead + c * velocity[1];
}

static void drop_first(gbt_own_track *track)
{
    for (int k = 1; k < track->count; k++) track->state[k - 1] = track->state[k];
    track->count--;
}

static gbt_received append(gbt_own_track *track, const gbt_own_state *state)
{
    const double oldest = state->time - LATE - GAP;
    if (track->count == GBT_NAVIGATIONS) drop_first(track);
    track->state[track->count++] = *state;
    while (track->count > 2 && track->state[1].time < oldest) drop_first(track);
    return GBT_TAKEN;
}

/* The number of states before a time, or at it. */
static int until(const gbt_own_track *track, double time)
{
    int place = track->count;
    while (place > 0 && track->state[place - 1].time > time) place--;
    return place;
}

gbt_received gbt_own_add(gbt_own_track *track, const gbt_own_state *state, double now)
{
    const double time = state->time, last = track->count > 0 ? track->state[track->count - 1].time : -HUGE_VAL;
    if (track->count == 0 || (last < time && time <= fmax(last, now) + GAP)) {
        track->doubted = 0;
        return append(track, state);
    }
    if (time > last) {
        const gbt_own_state before = track->doubtful;
        const int confirmed = track->doubted && time != before.time && fabs(time - before.time) <= GAP;
        track->doubtful = *state;
        track->doubted = 1;
        if (!confirmed) return GBT_AHEAD_OF_ALL;
        track->doubted = 0;
        append(track, before.time < time ? &before : state);
        append(track, before.time < time ? state : &before);
        return GBT_TAKEN;
    }
    if (time < fmax(last, now) - LATE) return GBT_TOO_OLD;
    int place = until(track, time);
    if (place > 0 && track->state[place - 1].time == time) return GBT_DUPLICATE;
    if (track->count == GBT_NAVIGATIONS) {
        if (place == 0) return GBT_TOO_OLD;
        drop_first(track);
        place--;
    }
    for (int k = track->count; k > place; k--) track->state[k] = track->state[k - 1];
    track->state[place] = *state;
    track->count++;
    return GBT_LATE;
}

int gbt_own_covers(const gbt_own_track *track, double time)
{
    return track->count > 0 && time <= track->state[track->count - 1].time;
}

int gbt_own_at(const gbt_own_track *track, double time, int bridging, gbt_own_state *state)
{
    const int place = until(track, time);
    if (place == 0) return 0;
    const gbt_own_state *before = &track->state[place - 1], *after = before + 1;
    *state = *before;
    state->time = time;
    if (before->time == time) return 1;
    if (place == track->count) {
        const gbt_real ahead = (gbt_real)fmin(time - before->time, GAP);
        for (int j = 0; j < GBT_POSE; j++) state->pose[j] += ahead * before->rates[j];
        return 1;
    }
    if (after->time - before->time > GAP && !bridging) return 0;
    const gbt_real span = (gbt_real)(after->time - before->time), s = (gbt_real)(time - before->time) / span;
    for (int j = 0; j < GBT_POSE; j++) {
        const gbt_real moved = after->pose[j] - before->pose[j], step = j >= D ? gbt_remainder(moved, GBT_TURN) : moved;
        const gbt_real first = before->rates[j], last = after->rates[j];
        /* the cubic of Hermite about the straight line between both */
        const gbt_real bent = (1 - s) * (span * first - step) - s * (span * last - step);
        const gbt_real slope = (1 - 2 * s) * bent - s * (1 - s) * (span * (first + last) - 2 * step);
        state->pose[j] = before->pose[j] + s * step + s * (1 - s) * bent;
        state->rates[j] = (step + slope) / span;
    }
    state->heading_std = gbt_fmax(before->heading_std, after->heading_std);
    return 1;
}
