#include "gbt_noise.h"

#include "gbt_math.h"

#define SURE_OF_SCATTER ((gbt_real)20) /* degrees of freedom of the scatter with which the expected noise weighs */

gbt_real gbt_white_variance(gbt_real std, int estimated, const gbt_bins *bins)
{
    const gbt_real expected = std * std;
    gbt_real squares = 0, freedom = 0;
    if (!estimated) return expected;
    for (int k = 0; k < bins->count; k++) {
        squares += bins->bin[k].squares;
        freedom += bins->bin[k].freedom;
    }
    return (squares + SURE_OF_SCATTER * expected) / (freedom + SURE_OF_SCATTER);
}

gbt_real gbt_noise_of_mean(const gbt_bearing_noise *noise, gbt_real count, double width, gbt_real range, gbt_real white)
{
    const gbt_real lasts = gbt_fmax(1, (gbt_real)(2 * noise->correlation_time / width)), own = noise->own_std / range;
    return (white + own * own) / count + noise->correlated_std * noise->correlated_std * lasts;
}
