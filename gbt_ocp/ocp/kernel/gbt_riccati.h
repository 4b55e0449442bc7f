/* Newton's step by a Riccati recursion: the trajectory is a linear system (derivatives 0 .. L-1, driven by the L-th),
   so the quadratic model of the problem is a linear-quadratic one, and the cost of a step is linear in the pieces. */
#ifndef GBT_RICCATI_H
#define GBT_RICCATI_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* Factorises work->curvature, with delta added for every derivative that is joined, from the rate on, at the end of a
   piece, in units of what an input of one changes it by within the piece. (Added to the inputs themselves, a long
   horizon would need far more of it: all later rates change with an early input. Added to the rates alone, it would
   leave derivatives above them free to alternate from piece to piece.) The pivots of the recursion are those of a block
   Cholesky factorisation of the Hessian with respect to all unknowns, last piece first: returns 1 if that is positive
   definite, 0 if not. */
int gbt_factorise(gbt_workspace *work, gbt_real delta);

/* work->step from the gradient with respect to the numbers of each piece, which is spent. */
void gbt_newton_step(gbt_workspace *work, gbt_real gradient[][GBT_ORDERS][GBT_FLAT]);

GBT_END_C

#endif
