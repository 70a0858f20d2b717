/* The link between a host and the cell: frames over a serial line or a network.
 *
 * A frame is COBS(payload, CRC-16) and a byte 0. Numbers are little-endian, as the machine must
 * store them. Requests and answers:
 *
 *   H                                          hello
 *   h, version, arithmetic, N_SENSORS, N_C, N_DESTINATIONS u8, hash of architecture and weights,
 *      session u16, ticks per second u32, label
 *   R, session u16                             reset the cell and begin a session
 *   r, session u16
 *   S, session u16, step u32, readings, words  step the cell
 *   s, session u16, step u32, actuation, words, ticks of the step u32
 *   n, session u16                             to S: no such session; 0 after a start
 *
 * A repeated request is answered from memory, not executed again. A damaged frame and a step
 * before the last one get no answer.
 */
#ifndef LINK_H
#define LINK_H

#include <stdint.h>

void link_receive(uint8_t byte); /* of the host */

/* Each board provides these. */
extern const uint32_t board_tick_rate; /* [Hz] */
uint32_t board_ticks(void);
void board_send(const uint8_t *bytes, unsigned n);

#endif
