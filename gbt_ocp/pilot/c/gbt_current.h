/* What is known of the velocity of the water, given or estimated from the own motion: guidance/current.py and
   guidance/water.py in C. Plans are made in the frame that moves with the water, where the vehicle obeys the same
   equations; GBT_CURRENT is 0 where they are made for still water, 1 where the velocity is given, 2 where it is
   estimated. */
#ifndef GBT_CURRENT_H
#define GBT_CURRENT_H

#include "gbt_forecast.h"
#include "gbt_own_track.h"

GBT_BEGIN_C

#if GBT_CURRENT
typedef struct {
    gbt_real velocity[GBT_DIMENSION];              /* over ground, earth frame, m/s */
    gbt_real spread[GBT_DIMENSION][GBT_DIMENSION]; /* its covariance, m^2/s^2; 0 where it is given */
    gbt_real planned_for[GBT_DIMENSION];           /* what the plan that is followed takes it for */
#if GBT_CURRENT == 2
    int learnt;                                    /* whether there is a state from which on it is learnt */
    gbt_own_state before;                          /* that state */
    int commands;
    struct {
        double time;
        gbt_real thrust[GBT_INPUTS];
    } command[GBT_COMMANDS];                       /* since then, and the one before */
#endif
} gbt_current;

/* Nothing learnt. */
void gbt_current_begin(gbt_current *current);

/* Derivatives of the flat output over ground as a frame sees them that moves with the water. */
void gbt_through_water(const gbt_current *current, gbt_real flat[GBT_JOINED][GBT_FLAT]);

/* The same of a forecast. */
void gbt_drift(const gbt_current *current, const gbt_forecast *forecast, gbt_forecast *drifting);
#endif

#if GBT_CURRENT == 2
/* Takes note of a thrust that is held from a time on. Where there is no memory for more, the oldest is forgotten. */
void gbt_current_command(gbt_current *current, double time, const gbt_real *thrust);

/* Learns from the motion since it last did, if that was half a period ago or more. */
void gbt_current_learn(gbt_current *current, const gbt_own_state *latest);

/* Generated: of (z, rate, acceleration), the velocity of the water and the inputs, what the inputs are less than those
   that the model needs; the slopes of the latter by the water, row by row; and those by the acceleration. */
void gbt_current_model(const gbt_real *point, const gbt_real *water, const gbt_real *inputs, gbt_real *out);
#endif

GBT_END_C

#endif
