#include "gbt_intake.h"

#include "gbt_math.h"

#define LATE (gbt_pilot_numbers.late)

/* Keeps the tracker's state as the last one. */
static void keep_state(gbt_intake *intake, const gbt_tracker *tracker)
{
    intake->since_state = 0;
    if (!(LATE > 0)) return;
    if (intake->states == GBT_KEPT_STATES)
        for (int k = 1; k < GBT_KEPT_STATES; k++) intake->state[k - 1] = intake->state[k];
    if (intake->states < GBT_KEPT_STATES) intake->states++;
    intake->state[intake->states - 1].time = intake->latest;
    intake->state[intake->states - 1].tracker = *tracker;
}

/* Forgets so many of the measurements that were taken, the oldest. */
static void forget(gbt_intake *intake, int count)
{
    intake->taken -= count;
    for (int k = 0; k < intake->taken + intake->arrived; k++) intake->sightings[k] = intake->sightings[k + count];
}

#if GBT_KEPT_STATES == 1
/* Gives the state what is older than a late measurement can be, all of one time. */
static void move_on(gbt_intake *intake, gbt_tracker_work *work)
{
    gbt_kept_state *state = &intake->state[0];
    int count = 0;
    for (; count < intake->taken; count++) {
        const gbt_sighting *sighting = &intake->sightings[count];
        const int old = sighting->time < intake->latest - LATE || intake->taken - count > GBT_BETWEEN_STATES;
        if (!old && sighting->time != state->time) break;
        gbt_tracker_take(&state->tracker, work, sighting);
        state->time = sighting->time;
    }
    if (count > 0) forget(intake, count);
}
#else
/* Before a measurement of a time is taken: keeps a state where the last one is old, and forgets what is older than a late
   measurement can be. Not between measurements of one time: those after a state are told from those in it by their times. */
static void move_on(gbt_intake *intake, const gbt_tracker *tracker, double time)
{
    const int old = time > intake->latest && intake->latest - intake->state[intake->states - 1].time >= LATE;
    int count = 0;
    if (!old && intake->since_state < GBT_BETWEEN_STATES) return;
    keep_state(intake, tracker);
    while (count < intake->taken && !(intake->sightings[count].time > intake->state[0].time)) count++;
    forget(intake, count);
}
#endif

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
#if GBT_KEPT_STATES > 1
        if (intake->states > 0) move_on(intake, tracker, intake->sightings[intake->taken].time);
#endif
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
#if GBT_KEPT_STATES == 1
        move_on(intake, work);
#endif
    }
    return refused;
}
