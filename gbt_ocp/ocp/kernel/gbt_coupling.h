/* Objectives that are functions of sums over the pieces, such as the determinant of an information matrix.

   With n the gradient of that function, each piece counts by n times what it adds to the sums, like any other term. Beyond
   that the sums couple all pieces with each other: their second derivatives. In the recursion of Newton's step the sums
   are further states, which nothing but a piece's end changes, and which cost only at the end of the plan. So a step
   is exact, its cost is linear in the pieces, and whether the Hessian is positive definite is seen by its pivots. */
#ifndef GBT_COUPLING_H
#define GBT_COUPLING_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* The objective from its terms and sums, GBT_TERMS. */
gbt_real gbt_gain(const gbt_real *total);

/* work->worth, work->bond and work->sum_slopes, at work->piece. */
void gbt_value_sums(gbt_workspace *work);

GBT_END_C

#endif
