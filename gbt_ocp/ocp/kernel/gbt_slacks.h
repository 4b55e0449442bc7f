/* The limits with their slacks: all that the method does one side at a time.

   A side with value y (positive: violated), weight c and half width w costs c h(y), h the smoothed hinge, which is

       min  c s + c e^2 / (4 w)   over  s >= 0, t >= 0, e   subject to  e + s - t = y + w

   (w = 0 has no e: then h is the hinge itself). With the barrier - mu log s - mu log t, the best s and t for given y
   and e have a closed form, so they are no variables of their own: what is left is a smooth function of y and e that
   is finite everywhere. Its slope is mu / t. The multiplier lambda is a second, independent estimate of that slope;
   with it in the Hessian, Newton's method converges as a primal-dual method does, also where mu is tiny. */
#ifndef GBT_SLACKS_H
#define GBT_SLACKS_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* lambda and e for work->y, at a start. */
void gbt_lift(gbt_workspace *work, gbt_real mu);

/* s and t for work->y and work->e. Returns the cost of all sides with the barrier, less mu times a number that depends on
   mu and the weights alone. */
gbt_real gbt_centre(gbt_workspace *work, gbt_real mu);

/* Distance from the central path: largest |lambda t - mu|, |nu s - mu| with nu = c - lambda, and what e is away from
   2 w lambda / c times lambda. */
gbt_real gbt_off_centre(const gbt_workspace *work, gbt_real mu);

/* work->sigma and work->step_of.target: once slacks and multipliers are eliminated from Newton's system, a side acts on the
   trajectory with stiffness sigma and multiplier target. */
void gbt_eliminate(gbt_workspace *work, gbt_real mu);

/* work->step_of.target again, with second-order terms: how y really changed in the trial step, and the products that the
   linearised complementarity dropped. */
void gbt_correct(gbt_workspace *work, gbt_real mu);

/* The step of e from work->step_of.dy, from which that of lambda follows. */
void gbt_recover(gbt_workspace *work);

/* The cost that gbt_centre returns, after a step alpha of e that led to work->y_trial. */
gbt_real gbt_barrier(const gbt_workspace *work, gbt_real mu, gbt_real alpha);

/* The slope of that cost along the step. */
gbt_real gbt_barrier_slope(const gbt_workspace *work, gbt_real mu);

/* Cost of all sides without barrier. */
gbt_real gbt_penalty(const gbt_workspace *work);

/* Takes a step alpha that led to work->y_trial, and leaves the share 1 - fraction of every multiplier. */
void gbt_move_sides(gbt_workspace *work, gbt_real mu, gbt_real alpha, gbt_real fraction);

GBT_END_C

#endif
