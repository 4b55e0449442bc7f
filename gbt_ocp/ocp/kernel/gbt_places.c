#include "gbt_places.h"

void gbt_begin(const double *base, const gbt_real *state, double *origin, gbt_real *start)
{
    for (int a = 0; a < GBT_STATE; a++) start[a] = state[a];
    for (int j = 0; j < GBT_DIMENSION; j++) {
        const double place = base[j] + (double)state[j];
        origin[j] = GBT_RELATIVE ? place : 0;
        start[j] = (gbt_real)(place - origin[j]);
    }
}

int gbt_state_size(void) { return GBT_STATE; }

int gbt_ends_size(void) { return GBT_END_NUMBERS; }

int gbt_knots_size(void) { return GBT_KNOT_NUMBERS; }

void gbt_place_ends(const double *origin, const double *parameters, int count, gbt_real *numbers)
{
    double found[GBT_END_NUMBERS + 1];
    for (int i = 0; i < count; i++) {
        gbt_end_numbers(origin, parameters + i * GBT_PARAMETERS, 0, found);
        for (int k = 0; k < GBT_END_NUMBERS; k++) numbers[i * GBT_END_NUMBERS + k] = (gbt_real)found[k];
    }
}

void gbt_place_knots(const double *origin, const double *moving, int count, gbt_real *numbers)
{
    double found[GBT_KNOT_NUMBERS + 1];
    for (int i = 0; i < count; i++) {
        gbt_knot_numbers(origin, moving + i * GBT_MOVING, 0, found);
        for (int k = 0; k < GBT_KNOT_NUMBERS; k++) numbers[i * GBT_KNOT_NUMBERS + k] = (gbt_real)found[k];
    }
}
