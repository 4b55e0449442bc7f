#include "gbt_slacks.h"

#include "gbt_math.h"

#define LIFT ((gbt_real)0.3) /* first multiplier of a violated side: small, however much it is violated */

/* The best s and t for s - t = excess, where m = mu / c: the minimum of s - m log s - m log t. The smaller one is
   written as a sum, since the difference that first comes to mind cancels. */
static void split(gbt_real excess, gbt_real m, gbt_real *s, gbt_real *t)
{
    const gbt_real size = gbt_fabs(excess), root = gbt_sqrt(size * size + 4 * m * m);
    const gbt_real large = m + (root + size) / 2, small = m + 2 * m * m / (root + size);
    *s = excess > 0 ? large : small;
    *t = excess > 0 ? small : large;
}

void gbt_lift(gbt_workspace *work, gbt_real mu)
{
    for (int k = 0; k < work->count; k++) {
        const gbt_real c = work->c[k], most = LIFT < c / 2 ? LIFT : c / 2;
        gbt_real s, t;
        split(work->y[k] + work->width[k], mu / c, &s, &t);
        work->lambda[k] = mu / t < most ? mu / t : most;
        work->e[k] = 2 * work->width[k] * work->lambda[k] / c;
    }
}

void gbt_centre(gbt_workspace *work, gbt_real mu)
{
    for (int k = 0; k < work->count; k++)
        split(work->y[k] + work->width[k] - work->e[k], mu / work->c[k], &work->s[k], &work->t[k]);
}

gbt_real gbt_off_centre(const gbt_workspace *work, gbt_real mu)
{
    gbt_real worst = 0;
    for (int k = 0; k < work->count; k++) {
        const gbt_real c = work->c[k], lambda = work->lambda[k];
        const gbt_real off[3] = {lambda * work->t[k] - mu, (c - lambda) * work->s[k] - mu,
                                 (2 * work->width[k] * lambda / c - work->e[k]) * lambda};
        for (int a = 0; a < 3; a++)
            if (gbt_fabs(off[a]) > worst) worst = gbt_fabs(off[a]);
    }
    return worst;
}

void gbt_eliminate(gbt_workspace *work, gbt_real mu)
{
    for (int k = 0; k < work->count; k++) {
        const gbt_real c = work->c[k], lambda = work->lambda[k], nu = c - lambda, soft = 2 * work->width[k] / c;
        const gbt_real s = work->s[k], t = work->t[k];
        work->sigma[k] = 1 / (soft + t / lambda + s / nu);
        work->shift[k] = (work->e[k] - soft * lambda) + (s - mu / nu) - (t - mu / lambda);
        work->target[k] = lambda + work->shift[k] * work->sigma[k];
    }
}

void gbt_correct(gbt_workspace *work, gbt_real mu)
{
    for (int k = 0; k < work->count; k++) {
        const gbt_real lambda = work->lambda[k], nu = work->c[k] - lambda, dlambda = work->dlambda[k];
        const gbt_real ds = mu / nu - work->s[k] + work->s[k] / nu * dlambda;
        const gbt_real dt = mu / lambda - work->t[k] - work->t[k] / lambda * dlambda;
        work->shift[k] += work->y_trial[k] - (work->y[k] + work->dy[k]) - dt * dlambda / lambda - ds * dlambda / nu;
        work->target[k] = lambda + work->shift[k] * work->sigma[k];
    }
}

void gbt_recover(gbt_workspace *work)
{
    for (int k = 0; k < work->count; k++) {
        work->dlambda[k] = (work->dy[k] + work->shift[k]) * work->sigma[k];
        work->de[k] = 2 * work->width[k] / work->c[k] * (work->lambda[k] + work->dlambda[k]) - work->e[k];
    }
}

gbt_real gbt_barrier(const gbt_workspace *work, const gbt_real *y, gbt_real mu, gbt_real alpha)
{
    gbt_real sum = 0;
    for (int k = 0; k < work->count; k++) {
        const gbt_real c = work->c[k], w = work->width[k], e = work->e[k] + alpha * work->de[k];
        gbt_real s, t;
        split(y[k] + w - e, mu / c, &s, &t);
        sum += c * s - mu * gbt_log(s * t);
        if (w > 0) sum += c * e * e / (4 * w);
    }
    return sum;
}

gbt_real gbt_barrier_slope(const gbt_workspace *work, gbt_real mu)
{
    gbt_real sum = 0;
    for (int k = 0; k < work->count; k++) {
        const gbt_real w = work->width[k], slope = mu / work->t[k];
        sum += slope * work->dy[k];
        if (w > 0) sum += (work->c[k] * work->e[k] / (2 * w) - slope) * work->de[k];
    }
    return sum;
}

gbt_real gbt_penalty(const gbt_workspace *work)
{
    gbt_real sum = 0;
    for (int k = 0; k < work->count; k++) {
        const gbt_real y = work->y[k], w = work->width[k];
        if (y > w)
            sum += work->c[k] * y;
        else if (y > -w)
            sum += work->c[k] * (y + w) * (y + w) / (4 * w);
    }
    return sum;
}

void gbt_move_sides(gbt_workspace *work, gbt_real alpha, gbt_real fraction)
{
    for (int k = 0; k < work->count; k++) {
        const gbt_real c = work->c[k], old = work->lambda[k];
        const gbt_real least = (1 - fraction) * old, most = c - (1 - fraction) * (c - old);
        /* The multipliers go half as short as the trajectory: they tell what comes, and have no line search to fear. */
        const gbt_real lambda = old + (1 + alpha) / 2 * work->dlambda[k];
        work->lambda[k] = lambda < least ? least : lambda > most ? most : lambda;
        work->e[k] += alpha * work->de[k];
        work->y[k] = work->y_trial[k];
    }
}
