#include "gbt_worth.h"

#include "gbt_check.h"
#include "gbt_coupling.h"
#include "gbt_form.h"
#include "gbt_math.h"

#define UNIT ((gbt_real)1) /* of a limit, by which a plan that gains more may break it more */

/* Returns what a plan gains, without penalty, and by how much it breaks the judged limits, at least 0; neither is finite
   where the plan is not. */
static gbt_real worth_of(const gbt_real *start, const gbt_real *top, const gbt_real *parameters, gbt_real *violation)
{
    gbt_real total[GBT_TERMS], broken[GBT_PIECES];
    gbt_piece piece;
    gbt_check(start, top, GBT_PIECES, GBT_FINE_POINTS, parameters + GBT_LIMIT_NUMBERS, broken);
    *violation = 0;
    for (int k = 0; k < GBT_TERMS; k++) total[k] = 0;
    for (int a = 0; a < GBT_STATE; a++) *gbt_inherited(piece, a) = start[a];
    for (int i = 0; i < GBT_PIECES; i++) {
        if (broken[i] > *violation) *violation = broken[i];
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = top[i * GBT_FREE + a];
        gbt_add_terms(piece, parameters + i * GBT_END_NUMBERS, total);
        gbt_next_piece(piece, piece);
    }
    for (int a = 0; a < GBT_STATE; a++)
        if (!isfinite(*gbt_inherited(piece, a))) return -GBT_INFINITY;
    return gbt_gain(total);
}

int gbt_beats_braking(const gbt_real *start, const gbt_real *top, const gbt_real *parameters)
{
    gbt_real braking[GBT_PIECES * GBT_FREE], broken, broken_by_braking;
    const gbt_real gain = worth_of(start, top, parameters, &broken);
    if (!isfinite(gain) || !isfinite(broken)) return 0;
    gbt_brake(start, braking);
    const gbt_real gain_of_braking = worth_of(start, braking, parameters, &broken_by_braking);
    if (!isfinite(gain_of_braking)) return 1;
    return broken <= broken_by_braking + UNIT && !(broken >= broken_by_braking && gain < gain_of_braking);
}

void gbt_fill_plan(const gbt_real *state, const gbt_real *parameters, gbt_plan_result *plan)
{
    gbt_piece piece;
    gbt_real total[GBT_TERMS];
    for (int k = 0; k < GBT_TERMS; k++) total[k] = 0;
    for (int a = 0; a < GBT_STATE; a++) *gbt_inherited(piece, a) = state[a];
    for (int i = 0; i < GBT_PIECES; i++) {
        for (int a = 0; a < GBT_FREE; a++) *gbt_free(piece, a) = plan->top[i][a];
        for (int k = 0; k < GBT_PROFILE; k++)
            gbt_inputs_after(piece, (gbt_real)k / (GBT_PROFILE - 1), plan->thrust[i][k]);
        gbt_add_terms(piece, parameters + i * GBT_END_NUMBERS, total);
        gbt_end_of(piece, plan->endpoints[i], plan->rates[i]);
        gbt_next_piece(piece, piece);
    }
    plan->objective = gbt_gain(total);
}
