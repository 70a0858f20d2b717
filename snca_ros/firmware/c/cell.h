/* The cell of one voxel: readings and messages in, actuation and messages out.
 *
 * There is one cell in a program. `snca firmware` has written `params.h`, its sizes and types of
 * numbers, and `weights.c`. A message has N_C words: trains of spikes, of which bit h is SNN step
 * h, or values. In integers (INTEGER), a reading of 1 is 65535, an actuation of 1 is 16384, and
 * potentials and thresholds count 2^-16 mV.
 */
#ifndef CELL_H
#define CELL_H

#include <stdint.h>

#include "params.h"

enum { SNN_STEPS = 16, N_RECEIVED = 4 * N_C, N_SENT = N_DESTINATIONS * N_C };

struct inputs {
    reading readings[N_SENSORS];
    word received[N_RECEIVED]; /* from above, left, below, right */
};

struct outputs {
    actuation actuation;
    word sent[N_SENT]; /* for above, left, below, right, or the same for all */
};

extern const weight weights[];   /* layer after layer, a row per neuron */
extern const uint8_t shifts[];   /* INTEGER: a weight w of layer l is w << shifts[l] units */
extern const number constants[]; /* per neuron: threshold at rest, its bound (as printed) or bias */

void cell_reset(void);
void cell_step(uint32_t step, const struct inputs *in, struct outputs *out); /* 60 per second */

#endif
