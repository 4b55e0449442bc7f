#include "gbt_waiting.h"

#include "gbt_math.h"

#define D GBT_DIMENSION

void gbt_waiting_begin(gbt_waiting *waiting)
{
    waiting->latest = -HUGE_VAL;
    gbt_waiting_clear(waiting);
}

void gbt_waiting_clear(gbt_waiting *waiting)
{
    waiting->full = 1;
    waiting->count = 0;
}

void gbt_waiting_shift(gbt_waiting *waiting, const gbt_real *way)
{
    for (int k = 0; k < waiting->count; k++)
        for (int j = 0; j < D; j++) {
            waiting->sighting[k].position[j] -= way[j];
            if (waiting->sighting[k].kind == GBT_POSITION) waiting->sighting[k].value[j] -= way[j];
        }
}

void gbt_waiting_forget(gbt_waiting *waiting, double width, double time)
{
    int rest = 0;
    for (int k = 0; k < waiting->count; k++)
        if (floor(waiting->sighting[k].time / width) == floor(time / width))
            waiting->sighting[rest++] = waiting->sighting[k];
    waiting->count = rest;
}

int gbt_waiting_room(const gbt_waiting *waiting, double width, double time)
{
    return waiting->count < GBT_OTHERS ||
           floor(waiting->sighting[waiting->count - 1].time / width) != floor(time / width);
}

void gbt_waiting_add(gbt_waiting *waiting, const gbt_sighting *sighting)
{
    waiting->sighting[waiting->count++] = *sighting;
}

int gbt_take_apart(const gbt_sighting *sighting, double latest, const gbt_bins *bins, const gbt_binning *binning,
                   gbt_real bearing_std, gbt_sighting_parts *parts)
{
    if (!isfinite(sighting->time) || !gbt_can_take(sighting, 1, latest)) return 0;
    if (gbt_is_bearing(sighting) && !sighting->stated && !(sighting->time > bins->latest)) return 0;
    gbt_parts_of(sighting, bearing_std, parts);
    return !parts->bearing || !gbt_bins_full(bins, binning, sighting->time);
}

gbt_real gbt_worth(const gbt_sighting_parts *parts, gbt_real bearing_std)
{
    const gbt_real ratio = parts->std > 0 ? bearing_std / parts->std : 1;
    return ratio * ratio;
}
