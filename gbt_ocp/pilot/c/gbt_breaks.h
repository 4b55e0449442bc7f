/* Corners: a window whose older bearings are of another motion than the newest. tracking/gp/breaks.py in C, which says
   why. */
#ifndef GBT_BREAKS_H
#define GBT_BREAKS_H

#include "gbt_bearing.h"

GBT_BEGIN_C

#define GBT_BEFORE 5 /* bearings in a row that have to be foreseen before a break is one */

typedef struct {
    int count; /* of the squares below, of the last bearings that were judged */
    gbt_real squares[GBT_BEFORE];
    int suspects; /* whether the latest bearing is a stray or the first after a break: the next one will say */
    gbt_real missed; /* how far it lies off the expected position, m */
} gbt_break_watch;

/* Nothing seen yet. */
void gbt_breaks_begin(gbt_break_watch *watch);

/* Judges a bearing before it is taken in; whether a break lies before the bearing before this one. `deviation` is then
   that of what the target moved off its old motion, on each axis, in m.

   mean, covariance   of the position at its time as the old motion has it, GBT_DIMENSION and its square
   noise              variance of a row of the window, m^2
   bearing, own       the sample: unit vector and own position, GBT_DIMENSION each
   elapsed            time since the bearing before it, s */
int gbt_breaks_judge(gbt_break_watch *watch, const gbt_real *mean, const gbt_real *covariance, gbt_real noise,
                     const gbt_real *bearing, const gbt_real *own, gbt_real elapsed, gbt_real *deviation);

GBT_END_C

#endif
