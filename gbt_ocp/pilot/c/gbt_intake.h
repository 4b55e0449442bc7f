/* Measurements into a tracker in the order of their times, whenever they arrive: pilot/late_measurements.py in C.

   A tracker takes measurements in that order only. Where one arrives that is older than the last that was taken, the
   tracker is set back to a state from before it and is given all of them again, with the late one at its place.

   The header of the tracker says how many such states are kept. Of two, the older one is left where the newer one is old
   enough. One alone lags behind: it takes each measurement once nothing older can come, so that a large tracker is there
   twice and not three times, and measurements are taken twice. */
#ifndef GBT_INTAKE_H
#define GBT_INTAKE_H

#include "gbt_tracker.h"

GBT_BEGIN_C

/* Measurements between two states. Where more come, the earlier one moves on, and what is late by less can be too old. */
#define GBT_BETWEEN_STATES GBT_MEASUREMENTS

typedef struct {
    double time; /* of the last measurement in it; minus infinity before the first */
    gbt_tracker tracker;
} gbt_kept_state;

typedef struct {
    double latest; /* time of the last measurement that was taken; minus infinity before the first */
    int begun;     /* new tracks of the tracker at that time */
    int states;    /* 0 where nothing late is taken, else up to GBT_KEPT_STATES */
    gbt_kept_state state[GBT_KEPT_STATES];
    int taken, since_state; /* measurements since the first and since the last state that is kept */
    int arrived;            /* and those that the tracker is to be given */
    gbt_sighting sightings[GBT_KEPT_STATES * GBT_BETWEEN_STATES + GBT_MEASUREMENTS]; /* those taken, then those arrived */
} gbt_intake;

/* The tracker has taken nothing yet. */
void gbt_intake_begin(gbt_intake *intake, const gbt_tracker *tracker);

/* Keeps a measurement until gbt_intake_settle; 0 if there are GBT_MEASUREMENTS already. */
int gbt_intake_add(gbt_intake *intake, const gbt_sighting *sighting);

/* Gives the tracker what has arrived; returns how many it did not take. */
int gbt_intake_settle(gbt_intake *intake, gbt_tracker *tracker, gbt_tracker_work *work);

GBT_END_C

#endif
