/* What the boards with a Cortex-M have in common: registers, and sleep until an interrupt. */
#ifndef CORTEX_M_H
#define CORTEX_M_H

#include <stdint.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))

/* Let interrupt n wake the processor; its handler never runs, for interrupts are masked. */
static inline void wake_by(unsigned n)
{
    __asm__ volatile("cpsid i" ::: "memory");
    REGISTER(0xe000e100) = 1U << n;
}

static inline void forget(unsigned n)
{
    REGISTER(0xe000e280) = 1U << n;
}

/* Sleep until an interrupt is pending. */
static inline void sleep(void)
{
    __asm__ volatile("wfi" ::: "memory");
}

#endif
