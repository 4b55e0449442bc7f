/* The follower of a plan by integration: its inputs, and a linear-quadratic regulator about where they lead.
   pilot/shot_follower.py in C. */
#ifndef GBT_REGULATOR_H
#define GBT_REGULATOR_H

#include "gbt_pilot_settings.h"
#include "gbt_solver.h"

GBT_BEGIN_C

#if GBT_SHOOTING

#define GBT_GRID (GBT_REACHED * GBT_PARTS) /* intervals of the grid on which a plan is known */

typedef struct {
    int planned; /* whether there is a plan */
    gbt_real state[GBT_GRID + 1][GBT_LAST], inputs[GBT_GRID][GBT_INPUTS], gain[GBT_GRID][GBT_INPUTS][GBT_LAST];
    int given;   /* whether inputs were given before, with the time, in seconds of the plan, from which their rates count */
    double given_at;
    gbt_real last[GBT_INPUTS];
} gbt_regulator;

/* Takes a plan: lays it out on the grid and computes the gains along it.

   start   the state from which it was made, GBT_STATE
   top     what is free in its pieces, GBT_PIECES x GBT_FREE */
void gbt_regulator_plan(gbt_regulator *regulator, const gbt_real *start, gbt_real top[GBT_PIECES][GBT_FREE]);

/* The same without a step in time: another plan in the place of the last one. */
void gbt_regulator_replace(gbt_regulator *regulator, const gbt_real *start, gbt_real top[GBT_PIECES][GBT_FREE]);

/* The inputs until the next sample, GBT_INPUTS, within their limits and the rates of gbt_pilot_numbers.

   now     seconds since the plan was made
   z, dz   measured first numbers of the state and their rates, GBT_FLAT each */
void gbt_regulator_inputs(gbt_regulator *regulator, double now, const gbt_real *z, const gbt_real *dz, gbt_real *inputs);

/* Generated: the state that has z and its rate, GBT_LAST; and from a state under inputs that are held for a part of the
   grid the state after it, then the rows of its derivatives for the state, then those for the inputs. */
void gbt_driven_state(const gbt_real *z, const gbt_real *dz, const gbt_real *third, gbt_real *state);
void gbt_grid_slopes(const gbt_real *state, const gbt_real *inputs, const gbt_real *third, gbt_real *out);

#endif

GBT_END_C

#endif
