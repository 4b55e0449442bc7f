#include "gbt_kalman.h"

#include "gbt_linalg.h"
#include "gbt_math.h"

#define N GBT_N

int gbt_kalman_update(gbt_real mean[N], gbt_real covariance[N][N], int rows, gbt_real observation[GBT_MOST_ROWS][N],
                      const gbt_real *std, const gbt_real *innovation)
{
    gbt_real cross[GBT_MOST_ROWS * N], spread[GBT_MOST_ROWS * GBT_MOST_ROWS], kept[N][N], root[N * N], half[N][N];
    for (int r = 0; r < rows; r++)
        for (int j = 0; j < N; j++) {
            cross[r * N + j] = 0;
            for (int k = 0; k < N; k++) cross[r * N + j] += observation[r][k] * covariance[k][j];
        }
    for (int r = 0; r < rows; r++)
        for (int q = 0; q < rows; q++) {
            spread[r * rows + q] = r == q ? std[r] * std[r] : 0;
            for (int k = 0; k < N; k++) spread[r * rows + q] += cross[r * N + k] * observation[q][k];
        }
    gbt_symmetric(spread, rows);
    /* the gain, transposed, takes the place of the cross covariance */
    if (!gbt_solve_square(spread, rows, cross, N)) return 0;
    gbt_covariance_root(&covariance[0][0], N, root);
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            kept[i][j] = i == j;
            for (int r = 0; r < rows; r++) kept[i][j] -= cross[r * N + i] * observation[r][j];
        }
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            half[i][j] = 0;
            for (int k = 0; k < N; k++) half[i][j] += kept[i][k] * root[k * N + j];
        }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            covariance[i][j] = 0;
            for (int k = 0; k < N; k++) covariance[i][j] += half[i][k] * half[j][k];
            for (int r = 0; r < rows; r++) covariance[i][j] += cross[r * N + i] * std[r] * std[r] * cross[r * N + j];
        }
        for (int r = 0; r < rows; r++) mean[i] += cross[r * N + i] * innovation[r];
    }
    gbt_symmetric(&covariance[0][0], N);
    return 1;
}
