/* The true limits of a trajectory, on a grid finer than the nodes: what decides whether a piece may be executed. */
#ifndef GBT_CHECK_H
#define GBT_CHECK_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* Largest violation of each piece in units of the limits, negative inside them, infinity where one is not a number,
   minus infinity without limits.

   start    the continuous derivatives, GBT_JOINED x GBT_FLAT
   top      what is free in each piece, pieces x GBT_FREE, not scaled
   pieces   how many, any number
   points   of the grid of a piece, both ends included, at least 2
   moving   of the limits at the boundaries, (pieces + 1) x GBT_MOVING */
void gbt_check(const gbt_real *start, const gbt_real *top, int pieces, int points, const gbt_real *moving,
               gbt_real *violation);

GBT_END_C

#endif
