/* Coordinates relative to the place where a plan begins: a plan spans metres, and single precision knows positions a
   thousand kilometres from the origin of their coordinates to half a metre. What depends on the origin is computed once
   a plan and in double precision; all else is relative. */
#ifndef GBT_PLACES_H
#define GBT_PLACES_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* The origin of a plan and its start relative to that, from the state.

   base     origin of the coordinates of the state, GBT_DIMENSION
   origin   out: GBT_DIMENSION; zero where GBT_RELATIVE is 0
   start    out: GBT_STATE */
void gbt_begin(const double *base, const gbt_real *state, double *origin, gbt_real *start);

/* GBT_STATE, GBT_END_NUMBERS and GBT_KNOT_NUMBERS, for callers that do not see the header. */
int gbt_state_size(void);
int gbt_ends_size(void);
int gbt_knots_size(void);

/* From the parameters of the objective at so many endpoints to its numbers, GBT_PARAMETERS to GBT_END_NUMBERS each. */
void gbt_place_ends(const double *origin, const double *parameters, int count, gbt_real *numbers);

/* The same of the limits at so many boundaries of pieces, GBT_MOVING to GBT_KNOT_NUMBERS each. */
void gbt_place_knots(const double *origin, const double *moving, int count, gbt_real *numbers);

GBT_END_C

#endif
