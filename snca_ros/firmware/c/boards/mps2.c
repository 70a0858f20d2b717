/* ARM's MPS2 boards with a Cortex-M3 (an385), M4F (an386) or M7 (an500): UART 0 and SysTick.
 *
 * Interrupts are masked; a pending one only wakes the processor from its sleep.
 */
#include "../link.h"
#include "cortex_m.h"

#define UART_DATA REGISTER(0x40004000)
#define UART_STATE REGISTER(0x40004004) /* bit 0: cannot send yet, bit 1: has received */
#define UART_CONTROL REGISTER(0x40004008)
#define UART_CLEAR REGISTER(0x4000400c)
#define UART_DIVISOR REGISTER(0x40004010)
#define SYSTICK_CONTROL REGISTER(0xe000e010)
#define SYSTICK_RELOAD REGISTER(0xe000e014)
#define SYSTICK_VALUE REGISTER(0xe000e018) /* counts down, 24 bits */

enum { CLOCK = 25000000, BAUD = 115200, UART_RECEIVE = 0 /* interrupt */ };

const uint32_t board_tick_rate = CLOCK;

uint32_t board_ticks(void)
{
    static uint32_t ticks, last = 0xffffff;
    uint32_t value = SYSTICK_VALUE;
    ticks += (last - value) & 0xffffff;
    last = value;
    return ticks;
}

void board_send(const uint8_t *bytes, unsigned n)
{
    for (; n > 0; n--) {
        while (UART_STATE & 1)
            ;
        UART_DATA = *bytes++;
    }
}

int main(void)
{
    SYSTICK_RELOAD = 0xffffff;
    SYSTICK_VALUE = 0;
    SYSTICK_CONTROL = 5; /* on, processor's clock, no interrupt */
    UART_DIVISOR = CLOCK / BAUD;
    UART_CONTROL = 1 | 2 | 8; /* send, receive, interrupt on reception */
    wake_by(UART_RECEIVE);
    for (;;) {
        forget(UART_RECEIVE);
        UART_CLEAR = 2;
        if (UART_STATE & 2)
            link_receive((uint8_t)UART_DATA);
        else
            sleep();
    }
}
