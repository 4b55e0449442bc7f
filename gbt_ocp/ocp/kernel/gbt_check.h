/* The true limits of a trajectory, on a grid finer than the nodes: what decides whether a piece may be executed. */
#ifndef GBT_CHECK_H
#define GBT_CHECK_H

#include "gbt_solver.h"

GBT_BEGIN_C

#define GBT_NODES 0 /* in the place of the number of points: each limit at its own nodes */

/* Largest violation of each limit in each piece in units of the limit, negative inside, infinity where one is not a
   number. What is given at the start is left out there. A steady limit is looked at where it is worst, at its nodes.

   start    the state where the trajectory begins, GBT_STATE
   top      what is free in each piece, pieces x GBT_FREE, not scaled
   pieces   how many, any number
   points   of the grid of a piece, both ends included, at least 2, or GBT_NODES
   moving   of the limits at the boundaries, (pieces + 1) x GBT_KNOT_NUMBERS */
void gbt_survey(const gbt_real *start, const gbt_real *top, int pieces, int points, const gbt_real *moving,
                gbt_real worst[][GBT_LIMITS + 1]);

/* Largest violation of the judged limits in each piece, minus infinity without any; the arguments are the same. */
void gbt_check(const gbt_real *start, const gbt_real *top, int pieces, int points, const gbt_real *moving,
               gbt_real *violation);

/* How far each limit is broken at the start, where no plan can change it; 0 where it is kept or not given there. */
void gbt_broken_at_start(const gbt_real *start, const gbt_real *moving, gbt_real violation[GBT_LIMITS + 1]);

GBT_END_C

#endif
