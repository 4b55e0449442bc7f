/* A measurement of any kind as a bearing with one deviation and a measurement of one number: tracking/decomposed.py in C. */
#ifndef GBT_SINGLES_H
#define GBT_SINGLES_H

#include "gbt_polar.h"

GBT_BEGIN_C

typedef struct {
    int bearing;                  /* whether there is one, */
    gbt_real unit[GBT_DIMENSION]; /* the direction, */
    gbt_real std;                 /* and its deviation, rad; 0 where the measurement did not say it */
    int single;                   /* whether there is a measurement of one number, */
    gbt_sighting rest;            /* which is no bearing */
} gbt_sighting_parts;

typedef struct {
    int count; /* measurements of one number, the oldest first; those of a sensor within a bin are averaged */
    struct {
        int averaged;
        gbt_sighting sighting;
    } single[GBT_OTHERS];
} gbt_singles;

/* Takes a measurement apart; bearing_std is the deviation of angles that do not state theirs. */
void gbt_parts_of(const gbt_sighting *sighting, gbt_real bearing_std, gbt_sighting_parts *parts);

/* Time of the latest one; minus infinity without any. */
double gbt_singles_latest(const gbt_singles *singles);

/* Adds a measurement of one number; bins are so wide, s. Where there is no room the oldest one is forgotten. */
void gbt_singles_add(gbt_singles *singles, double width, const gbt_sighting *single);

/* Forgets those from before a time. */
void gbt_singles_forget(gbt_singles *singles, double time);

GBT_END_C

#endif
