/* Weights of the components of held turn rates, and what all of them together say: Components of tracking/held/bank.py in C, and
   the moments of tracking/held/held_turn.py. Numbers of components are those that are kept, then from GBT_COMPONENTS on those
   that draw again, of which `again` says how many there are. */
#ifndef GBT_HELD_WEIGHTS_H
#define GBT_HELD_WEIGHTS_H

#include "gbt_held_turn.h"

GBT_BEGIN_C

#define GBT_FORGOTTEN ((gbt_real)1e-6) /* weight below which a component is dropped */

/* A component by its number. */
gbt_component *gbt_held_slot(gbt_held_turn *tracker, gbt_held_turn_work *work, int slot);

/* Their probabilities, in the workspace. */
void gbt_held_weigh(gbt_held_turn *tracker, gbt_held_turn_work *work, int again);

/* Keeps the likeliest, at most so many, with more than a least weight, in the order of their weights. */
void gbt_held_keep_likeliest(gbt_held_turn *tracker, gbt_held_turn_work *work, int again, int most, gbt_real least);

/* Whether components are reported at the median range: where the deviation of the log range, of which the sum of weights, the
   weighed mean and the weighed mean square are given, is large. */
int gbt_held_at_median(gbt_real total, gbt_real mean, gbt_real square);

/* Whether they tell the range to a quarter. */
int gbt_held_observable(gbt_held_turn *tracker, gbt_held_turn_work *work, int again);

/* What is known of now and ahead, of the components that are kept. */
void gbt_held_look_ahead(gbt_held_turn *tracker, const gbt_held_turn_settings *settings, gbt_held_turn_work *work);

GBT_END_C

#endif
