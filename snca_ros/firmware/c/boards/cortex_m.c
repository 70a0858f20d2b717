/* Start of a Cortex-M: vector table, memory, floating-point unit. */
#include "cortex_m.h"

extern uint32_t stack_top[], data_start[], data_end[], data_source[], bss_start[], bss_end[];

int main(void);
void start(void);

static void stop(void)
{
    for (;;)
        sleep();
}

/* The vector table: the stack, then handlers. Interrupts are masked, so that only faults come. */
__attribute__((section(".vectors.stack"), used)) static uint32_t *const stack = stack_top;
__attribute__((section(".vectors.handlers"), used)) static void (*const handlers[15])(void) = {
    start, stop, stop, stop, stop, stop,
};

void start(void)
{
    const uint32_t *from = data_source;
    for (uint32_t *to = data_start; to < data_end;)
        *to++ = *from++;
    for (uint32_t *to = bss_start; to < bss_end;)
        *to++ = 0;
#ifdef __ARM_FP
    REGISTER(0xe000ed88) |= 0xf << 20; /* access to the floating-point unit */
    __asm__ volatile("dsb\n\tisb" ::: "memory");
#endif
    main();
    stop();
}
