/* The trajectory and its derivatives, piece by piece. A piece is described by the derivatives 0 .. L of the flat output
   at its beginning; the first GBT_JOINED of them follow from the piece before, the others are free. */
#ifndef GBT_PIECES_H
#define GBT_PIECES_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* Number a of what is free in a piece. */
static inline gbt_real *gbt_free(gbt_real piece[GBT_ORDERS][GBT_FLAT], int a)
{
    return &piece[GBT_JOINED + a / GBT_FLAT][a % GBT_FLAT];
}

/* power[k] = s^k / k!: how much of derivative o + k at the beginning is in derivative o after s seconds. */
void gbt_taylor(gbt_real s, gbt_real power[GBT_ORDERS]);

/* z, its rate and its acceleration after s seconds of a piece. */
void gbt_point_after(gbt_real piece[GBT_ORDERS][GBT_FLAT], gbt_real s, gbt_real *point);

/* The numbers that constraints need at a share of a piece, from those at its two ends: the last of a place. */
void gbt_moving_at(const gbt_real *ends, gbt_real share, gbt_real *place);

/* The continuous derivatives at the end of a piece; next may be the piece itself. */
void gbt_next_piece(gbt_real piece[GBT_ORDERS][GBT_FLAT], gbt_real next[GBT_ORDERS][GBT_FLAT]);

/* Fills the inherited derivatives of all pieces but the first from what is free. */
void gbt_propagate(gbt_real piece[][GBT_ORDERS][GBT_FLAT], int pieces);

/* Sets the lowest free derivative of a piece so that derivative `first` of the flat output becomes `aim`, and those above
   it zero, in as few pieces as there are inherited ones of them; what is free above it is not touched. */
void gbt_settle(gbt_real piece[GBT_ORDERS][GBT_FLAT], int first, const gbt_real *aim);

#define GBT_ASIDE ((gbt_real)1e-5) /* of the full thrust, at a cold start */

/* Constant velocity, and a little thrust to one side: from a start that is symmetric, as dead ahead of an obstacle, steps
   are so too, and may creep along a ridge between two plans. The ratios of the thrusts are irrational, so that no axis of
   symmetry of rational numbers is along them. Inherited accelerations settle there.

   aside    of the full thrust
   top      out: GBT_PIECES x GBT_FREE, what is free in all pieces */
void gbt_coast(const gbt_real *start, gbt_real aside, gbt_real *top);

/* Gradient with respect to what is free in all pieces, from the one with respect to the numbers of each piece
   (which is spent): the adjoint of gbt_propagate. */
void gbt_adjoint(gbt_real gradient[][GBT_ORDERS][GBT_FLAT], int pieces, gbt_real out[][GBT_FREE]);

/* Objective and sides of the limits; returns f, minus the objective. */
gbt_real gbt_evaluate(const gbt_workspace *work, gbt_real piece[][GBT_ORDERS][GBT_FLAT], gbt_real *y);

/* At work->piece: gradient of f, and the Jacobians of the limits at all nodes. */
void gbt_differentiate(gbt_workspace *work);

/* out += the Jacobians transposed times one number for each side. */
void gbt_pull_back(const gbt_workspace *work, const gbt_real *sides, gbt_real out[][GBT_ORDERS][GBT_FLAT]);

/* work->dy: the change of every side along work->step. */
void gbt_push_forward(gbt_workspace *work);

/* work->curvature: Hessian of f + lambda y, plus the Jacobians' squares weighted with work->sigma. */
void gbt_assemble(gbt_workspace *work);

GBT_END_C

#endif
