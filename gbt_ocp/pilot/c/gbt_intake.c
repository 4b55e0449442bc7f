#include "gbt_intake.h"

#include "gbt_math.h"

#define LATE (gbt_pilot_numbers.late)

/* Keeps the tracker's state, and forgets what is older than a late measurement can be. */
static void keep_state(gbt_intake *intake, const gbt_tracker *tracker)
{
    int rest = 0;
    intake->since_state = 0;
    if (LATE > 0) {
        if (intake->states == 2) intake->state[0] = intake->state[1];
        if (intake->states < 2) intake->states++;
        intake->state[intake->states - 1].time = intake->latest;
        intake->state[intake->states - 1].tracker = *tracker;
    }
    const double oldest = intake->states > 0 ? intake->state[0].time : HUGE_VAL;
    for (int k = 0; k < intake->taken; k++)
        if (intake->taken_sightings[k].time > oldest) intake->taken_sightings[rest++] = intake->taken_sightings[k];
    intake->taken = rest;
}

void gbt_intake_begin(gbt_intake *intake, const gbt_tracker *tracker)
{
    intake->latest = -HUGE_VAL;
    intake->begun = intake->states = intake->taken = intake->arrived = 0;
    keep_state(intake, tracker);
}

int gbt_intake_add(gbt_intake *intake, const gbt_sighting *sighting)
{
    if (intake->arrived >= GBT_MEASUREMENTS) return 0;
    intake->arrived_sightings[intake->arrived++] = *sighting;
    return 1;
}

/* In the order of time; what has one time stays in its order. */
static void sort(gbt_sighting *sightings, int count)
{
    for (int k = 1; k < count; k++) {
        const gbt_sighting one = sightings[k];
        int place = k;
        for (; place > 0 && sightings[place - 1].time > one.time; place--) sightings[place] = sightings[place - 1];
        sightings[place] = one;
    }
}

/* Sets the tracker back to before what is late, and puts what is to be given again to what has arrived; returns how many
   are too old. */
static int set_back(gbt_intake *intake, gbt_tracker *tracker)
{
    gbt_sighting *arrived = intake->arrived_sightings;
    const double oldest = intake->states > 0 ? intake->state[0].time : HUGE_VAL;
    int rest = 0, again = 0, kept = 0;
    for (int k = 0; k < intake->arrived; k++)
        if (arrived[k].time > oldest || arrived[k].time >= intake->latest) arrived[rest++] = arrived[k];
    const int refused = intake->arrived - rest;
    intake->arrived = rest;
    if (rest == 0 || arrived[0].time >= intake->latest) return refused;
    while (intake->state[intake->states - 1].time >= arrived[0].time) intake->states--;
    intake->latest = intake->state[intake->states - 1].time;
    *tracker = intake->state[intake->states - 1].tracker;
    for (int k = 0; k < intake->taken; k++) again += intake->taken_sightings[k].time > intake->latest;
    /* those that are given again come first among those of one time */
    for (int k = rest - 1; k >= 0; k--) arrived[k + again] = arrived[k];
    again = 0;
    for (int k = 0; k < intake->taken; k++)
        if (intake->taken_sightings[k].time > intake->latest)
            arrived[again++] = intake->taken_sightings[k];
        else
            intake->taken_sightings[kept++] = intake->taken_sightings[k];
    intake->taken = kept;
    intake->since_state = 0;
    intake->arrived = rest + again;
    sort(arrived, intake->arrived);
    return refused;
}

int gbt_intake_settle(gbt_intake *intake, gbt_tracker *tracker)
{
    int refused = 0;
    sort(intake->arrived_sightings, intake->arrived);
    if (intake->arrived > 0 && intake->arrived_sightings[0].time < intake->latest) refused = set_back(intake, tracker);
    for (int k = 0; k < intake->arrived; k++) {
        const gbt_sighting *sighting = &intake->arrived_sightings[k];
        if (!gbt_tracker_take(tracker, sighting)) {
            refused++;
            continue;
        }
        intake->begun = gbt_new_tracks(tracker);
        intake->latest = sighting->time;
        if (intake->states == 0) continue;
        intake->taken_sightings[intake->taken++] = *sighting;
        intake->since_state++;
        if (sighting->time - intake->state[intake->states - 1].time >= LATE || intake->since_state >= GBT_BETWEEN_STATES)
            keep_state(intake, tracker);
    }
    intake->arrived = 0;
    return refused;
}
