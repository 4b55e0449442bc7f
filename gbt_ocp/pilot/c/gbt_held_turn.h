/* Tracker of noisy bearings whose target holds a turn rate and changes it now and then: tracking/held/held_turn.py in C.

   Between two bins that are full the components are kept, the likeliest first, and moments of the position at nodes ahead.
   What a step needs beside these is a workspace that keeps nothing from one to the next. */
#ifndef GBT_HELD_TURN_H
#define GBT_HELD_TURN_H

#include <stddef.h>

#include "gbt_gaps.h"
#include "gbt_held_ahead.h"
#include "gbt_held_draws.h"
#include "gbt_waiting.h"
#include "gbt_lost.h"
#include "gbt_mixed.h"
#include "gbt_noise.h"

GBT_BEGIN_C

#define GBT_HELD_SLOTS (GBT_COMPONENTS + GBT_CELLS) /* of components before the likeliest are kept */

typedef struct {
    gbt_held_prior prior;
    gbt_bearing_noise noise;
    gbt_binning binning;
    int starts[3];  /* ranges, speeds and courses at which a track is begun, under each deviation of the turn rate */
    int components; /* kept once it has begun */
    int known;      /* 1: the position at the first bearing is known */
    gbt_real known_mean[GBT_DIMENSION], known_covariance[GBT_DIMENSION][GBT_DIMENSION];
} gbt_held_turn_settings;

typedef struct {
    double now, first;           /* times of the latest full bin, and of the first bearing of the track, s */
    gbt_real own[GBT_DIMENSION]; /* own position at the latest full bin, or where the track began */
    int known, found;            /* whether a position was known, and whether there was a bearing */
    int count;                   /* of components; they are weighed by e to their log weight */
    int observable;              /* whether the range is known to a quarter */
    int nodes;                   /* ahead that are known: as many as forecasts were asked for */
    int restarts;                /* how often the track was lost and begun again */
    gbt_gaps gaps;
    gbt_lost lost;
    gbt_component component[GBT_COMPONENTS]; /* the likeliest first */
    gbt_real mean[GBT_HELD_NODES][GBT_DIMENSION]; /* at the nodes ahead, relative to the own position */
    gbt_real covariance[GBT_HELD_NODES][GBT_DIMENSION][GBT_DIMENSION];
    gbt_bins bins;
    gbt_real zero[GBT_DIMENSION]; /* where the coordinates of the settings begin */
    gbt_waiting waiting;          /* for the first bearing */
} gbt_held_turn;

/* What a step works on. */
typedef struct {
    gbt_real weight[GBT_HELD_SLOTS];
    union {
        gbt_component again[GBT_CELLS]; /* those that draw their turn rate again; after they are kept or forgotten, */
        struct {
            gbt_mixed mixed[GBT_HELD_NODES];
            gbt_fading fading;
            gbt_ahead ahead;
        } look;
    } room;
    union {
        gbt_cells cells; /* while those are drawn; then, */
        struct {
            gbt_real square[GBT_HELD_SLOTS];
            short order[GBT_HELD_SLOTS];
        } judged;
    } list;
} gbt_held_turn_work;

/* Sizes of both, for callers that do not see the structs. */
size_t gbt_held_turn_bytes(void);
size_t gbt_held_turn_work_bytes(void);

/* Nothing taken yet, with the vehicle at start, GBT_DIMENSION. */
void gbt_held_turn_begin(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, const gbt_real *start);

/* Moves the origin of all positions by a way, GBT_DIMENSION. */
void gbt_held_turn_shift(gbt_held_turn *tracker, const gbt_real *way);

/* Takes a bearing, a unit vector, from a position, both finite; 0 where its time is not after that of the last one, or where
   there is no room for it in its bin. */
int gbt_held_turn_update(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work,
                         double time, const gbt_real *bearing, const gbt_real *own);

/* Takes a measurement of any kind; 0 where gbt_can_take refuses it, or where there is no room. */
int gbt_held_turn_take(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work,
                       const gbt_sighting *sighting);

/* Gets ready to be asked for forecasts as far ahead as a time, from now on. */
void gbt_held_turn_ask(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work, double time);

/* Where the target is at a time, and the covariance of that. */
void gbt_held_turn_predict(const gbt_held_turn *tracker, const gbt_held_turn_settings *settings, double time,
                           gbt_real *mean, gbt_real *covariance);

/* The same at so many times, however far ahead. */
void gbt_held_turn_forecast(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work,
                         const double *time, int count, gbt_real *mean, gbt_real *covariance);

GBT_END_C

#endif
