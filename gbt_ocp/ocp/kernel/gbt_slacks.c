#include "gbt_slacks.h"

#include "gbt_math.h"

#define BLOCK 64 /* sides that are taken together, so that the compiler can do several at once */
#ifdef GBT_SINGLE
#define TOGETHER 2 /* sides of one logarithm */
#else
#define TOGETHER 8
#endif
#define LIFT ((gbt_real)0.3) /* first multiplier of a violated side: small, however much it is violated */

/* The best s and t for s - t = excess, where m = mu / c: the minimum of s - m log s - m log t. The smaller one is
   written as a sum, since the difference that first comes to mind cancels. Returns s + t, which is s t / m. */
static inline gbt_real split(gbt_real excess, gbt_real m, gbt_real *s, gbt_real *t)
{
    const gbt_real size = gbt_fabs(excess), root = gbt_sqrt(size * size + 4 * m * m);
    const gbt_real large = m + (root + size) / 2, small = m + 2 * m * m / (root + size);
    *s = excess > 0 ? large : small;
    *t = excess > 0 ? small : large;
    return 2 * m + root;
}

/* e after a step alpha; without penalties there is none. */
static inline gbt_real e_after(const gbt_workspace *work, int k, gbt_real alpha)
{
    return GBT_SOFT ? work->e[k] + alpha * work->de[k] : 0;
}

/* Slacks at the values y of the sides after a step alpha of e, and the cost there. Since s t = m (s + t), the barrier is
   mu times the logarithm of the product of all s + t, which is taken of some factors together: that of so many neither
   overflows nor vanishes. */
static gbt_real spread(const gbt_workspace *work, const gbt_real *y, gbt_real mu, gbt_real alpha, gbt_real *s,
                       gbt_real *t)
{
    gbt_real sum = 0, logarithms = 0, both[BLOCK];
    for (int first = 0; first < work->count; first += BLOCK) {
        const int count = work->count - first < BLOCK ? work->count - first : BLOCK;
        for (int b = 0, k = first; b < count; b++, k++)
            both[b] = split(y[k] + work->width[k] - e_after(work, k, alpha), mu * work->inverse[k], &s[k], &t[k]);
        for (int b = 0, k = first; b < count;) {
            gbt_real product = 1;
            for (const int end = b + TOGETHER < count ? b + TOGETHER : count; b < end; b++, k++) {
                product *= both[b];
                sum += work->c[k] * s[k];
            }
            logarithms += gbt_log(product);
        }
    }
    for (int k = 0; k < work->count && GBT_SOFT; k++) {
        const gbt_real w = work->width[k], e = e_after(work, k, alpha);
        if (w > 0) sum += work->c[k] * e * e / (4 * w);
    }
    return sum - mu * logarithms;
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

gbt_real gbt_centre(gbt_workspace *work, gbt_real mu)
{
    return spread(work, work->y, mu, 0, work->s, work->t);
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
        const gbt_real lambda = work->lambda[k], soft = 2 * work->width[k] * work->inverse[k];
        const gbt_real inverse_lambda = 1 / lambda, inverse_nu = 1 / (work->c[k] - lambda);
        const gbt_real s = work->s[k], t = work->t[k];
        work->sigma[k] = 1 / (soft + t * inverse_lambda + s * inverse_nu);
        work->shift[k] = (work->e[k] - soft * lambda) + (s - mu * inverse_nu) - (t - mu * inverse_lambda);
        work->target[k] = lambda + work->shift[k] * work->sigma[k];
    }
}

void gbt_correct(gbt_workspace *work, gbt_real mu)
{
    for (int k = 0; k < work->count; k++) {
        const gbt_real lambda = work->lambda[k], dlambda = work->dlambda[k];
        const gbt_real inverse_lambda = 1 / lambda, inverse_nu = 1 / (work->c[k] - lambda);
        const gbt_real ds = (mu + work->s[k] * dlambda) * inverse_nu - work->s[k];
        const gbt_real dt = (mu - work->t[k] * dlambda) * inverse_lambda - work->t[k];
        work->shift[k] += work->y_trial[k] - (work->y[k] + work->dy[k]) -
                          dlambda * (dt * inverse_lambda + ds * inverse_nu);
        work->target[k] = lambda + work->shift[k] * work->sigma[k];
    }
}

void gbt_recover(gbt_workspace *work)
{
    for (int k = 0; k < work->count; k++) work->dlambda[k] = (work->dy[k] + work->shift[k]) * work->sigma[k];
    for (int k = 0; k < work->count && GBT_SOFT; k++)
        work->de[k] = 2 * work->width[k] * work->inverse[k] * (work->lambda[k] + work->dlambda[k]) - work->e[k];
}

gbt_real gbt_barrier(gbt_workspace *work, gbt_real mu, gbt_real alpha)
{
    return spread(work, work->y_trial, mu, alpha, work->s_trial, work->t_trial);
}

gbt_real gbt_barrier_slope(const gbt_workspace *work, gbt_real mu)
{
    gbt_real sum = 0, change[BLOCK];
    for (int first = 0; first < work->count; first += BLOCK) {
        const int count = work->count - first < BLOCK ? work->count - first : BLOCK;
        for (int b = 0, k = first; b < count; b++, k++)
            change[b] = (work->dy[k] - (GBT_SOFT ? work->de[k] : 0)) / work->t[k];
        for (int b = 0; b < count; b++) sum += mu * change[b];
    }
    for (int k = 0; k < work->count && GBT_SOFT; k++) {
        const gbt_real w = work->width[k];
        if (w > 0) sum += work->c[k] * work->e[k] / (2 * w) * work->de[k];
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
        work->y[k] = work->y_trial[k];
        work->s[k] = work->s_trial[k];
        work->t[k] = work->t_trial[k];
    }
    for (int k = 0; k < work->count && GBT_SOFT; k++) work->e[k] += alpha * work->de[k];
}
