/* BBC micro:bit V1, nRF51822: UART over the USB connector, timer 0.
 *
 * Interrupts are masked; a pending one only wakes the processor from its sleep.
 */
#include "../link.h"
#include "cortex_m.h"

#define CLOCK_START REGISTER(0x40000000) /* of the crystal, which the UART needs */
#define CLOCK_STARTED REGISTER(0x40000100)
#define UART_START_RECEIVING REGISTER(0x40002000)
#define UART_START_SENDING REGISTER(0x40002008)
#define UART_RECEIVED REGISTER(0x40002108)
#define UART_SENT REGISTER(0x4000211c)
#define UART_INTERRUPTS REGISTER(0x40002304)
#define UART_ENABLE REGISTER(0x40002500)
#define UART_PIN_TXD REGISTER(0x4000250c)
#define UART_PIN_RXD REGISTER(0x40002514)
#define UART_RXD REGISTER(0x40002518)
#define UART_TXD REGISTER(0x4000251c)
#define UART_BAUD REGISTER(0x40002524)
#define TIMER_START REGISTER(0x40008000)
#define TIMER_CAPTURE REGISTER(0x40008040)
#define TIMER_BITS REGISTER(0x40008508)
#define TIMER_PRESCALER REGISTER(0x40008510)
#define TIMER_VALUE REGISTER(0x40008540)

enum { UART = 2 /* interrupt */, PIN_TXD = 24, PIN_RXD = 25 };

const uint32_t board_tick_rate = 16000000;

uint32_t board_ticks(void)
{
    TIMER_CAPTURE = 1;
    return TIMER_VALUE;
}

void board_send(const uint8_t *bytes, unsigned n)
{
    for (; n > 0; n--) {
        UART_SENT = 0;
        UART_TXD = *bytes++;
        while (!UART_SENT)
            ;
    }
}

int main(void)
{
    CLOCK_START = 1;
    while (!CLOCK_STARTED)
        ;
    TIMER_BITS = 3; /* 32 bits */
    TIMER_PRESCALER = 0;
    TIMER_START = 1;
    UART_PIN_TXD = PIN_TXD;
    UART_PIN_RXD = PIN_RXD;
    UART_BAUD = 0x01d7e000; /* 115200; 0x10000000 is 1 Mbaud */
    UART_ENABLE = 4;
    UART_INTERRUPTS = 1 << 2; /* reception */
    UART_START_RECEIVING = 1;
    UART_START_SENDING = 1;
    wake_by(UART);
    for (;;) {
        forget(UART);
        if (UART_RECEIVED) {
            UART_RECEIVED = 0; /* before the answer: the host may send at once */
            link_receive((uint8_t)UART_RXD);
        } else {
            sleep();
        }
    }
}
