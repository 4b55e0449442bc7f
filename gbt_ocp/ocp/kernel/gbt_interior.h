/* The interior-point method itself, on the first work->pieces pieces from where they are. */
#ifndef GBT_INTERIOR_H
#define GBT_INTERIOR_H

#include "gbt_solver.h"

GBT_BEGIN_C

/* The last mu: it bounds what the objective loses by the barrier. */
gbt_real gbt_last_barrier(const gbt_settings *settings);

/* Iterates from work->piece while mu falls to mu_last and until the gradient of the Lagrangian is within the tolerance,
   at most so many times. Returns GBT_FAR, and changes nothing, where the first step promises a decrease of more than
   reach times mu for each side: no step of that length is one of Newton's. Adds to result->iterations what it took and
   sets result->residual. */
gbt_status gbt_minimise(gbt_real tolerance, gbt_real mu, gbt_real mu_last, gbt_real reach, int iterations,
                        gbt_workspace *work, gbt_result *result);

/* The same until the hard limits are kept or no weight helps, or result->iterations has come to the deadline: the
   solved problem keeps all of them (GBT_SOLVED), all of thrust (GBT_GIVEN_UP), or not even those. */
gbt_status gbt_minimise_within_limits(const gbt_settings *settings, gbt_real mu, gbt_real reach, int deadline,
                                      gbt_workspace *work, gbt_result *result);

/* c and the half width of every side; the weights are those of the hard limits on thrust and of the others, each times
   what its class weighs. */
void gbt_weigh_limits(gbt_workspace *work, gbt_real thrust, gbt_real others);

/* Which limits: all, the hard ones on thrust, the other hard ones. */
typedef enum { GBT_ALL, GBT_HARD_THRUST, GBT_HARD_OTHERS } gbt_which;

/* Largest side of these limits. */
gbt_real gbt_worst_side(const gbt_workspace *work, gbt_which which);

/* Newton's step at work->piece, ready but for the gradient: all derivatives, slacks and multipliers at mu, the factors.
   Returns 0 where that fails. */
int gbt_make_ready(gbt_workspace *work, gbt_real mu);

/* work->pull: the gradient of f plus the Jacobians transposed times these multipliers, piece by piece. */
void gbt_lagrangian_gradient(gbt_workspace *work, const gbt_real *multipliers);

int gbt_all_finite(const gbt_real *x, int count);

GBT_END_C

#endif
