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
    for (int k = 0; k < intake->taken + intake->arrived; k++)
        if (k >= intake->taken || intake->sightings[k].time > oldest) intake->sightings[rest++] = intake->sightings[k];
    intake->taken = rest - intake->arrived;
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
    intake->sightings[intake->taken + intake->arrived++] = *sighting;
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

/* Sets the tracker back to before what is late, so that what it has taken since then has arrived again; returns how many
   are too old. */
static int set_back(gbt_intake *intake, gbt_tracker *tracker)
{
    gbt_sighting *arrived = &intake->sightings[intake->taken];
    const double oldest = intake->states > 0 ? intake->state[0].time : HUGE_VAL;
    int rest = 0, again = 0;
    for (int k = 0; k < intake->arrived; k++)
        if (arrived[k].time > oldest || arrived[k].time >= intake->latest) arrived[rest++] = arrived[k];
    const int refused = intake->arrived - rest;
    intake->arrived = rest;
    if (rest == 0 || arrived[0].time >= intake->latest) return refused;
    while (intake->state[intake->states - 1].time >= arrived[0].time) intake->states--;
    intake->latest = intake->state[intake->states - 1].time;
    *tracker = intake->state[intake->states - 1].tracker;
    /* what was taken is in the order of time; among those of one time it comes first */
    while (again < intake->taken && intake->sightings[intake->taken - again - 1].time > intake->latest) again++;
    intake->taken -= again;
    intake->arrived += again;
    intake->since_state = 0;
    sort(&intake->sightings[intake->taken], intake->arrived);
    return refused;
}

int gbt_intake_settle(gbt_intake *intake, gbt_tracker *tracker, gbt_tracker_work *work)
{
    int refused = 0;
    gbt_sighting *first = &intake->sightings[intake->taken];
    sort(first, intake->arrived);
    if (intake->arrived > 0 && first->time < intake->latest) refused = set_back(intake, tracker);
    while (intake->arrived > 0) {
        gbt_sighting *sighting = &intake->sightings[intake->taken];
        const int took = gbt_tracker_take(tracker, work, sighting);
        intake->arrived--;
        if (took) {
            intake->begun = gbt_new_tracks(tracker);
            intake->latest = sighting->time;
        } else {
            refused++;
        }
        if (!took || intake->states == 0) {
            for (int k = 0; k < intake->arrived; k++) sighting[k] = sighting[k + 1];
            continue;
        }
        intake->taken++;
        intake->since_state++;
        if (intake->latest - intake->state[intake->states - 1].time >= LATE || intake->since_state >= GBT_BETWEEN_STATES)
            keep_state(intake, tracker);
    }
    return refused;
}
