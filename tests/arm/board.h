/* What the programs for the emulated board share: instructions that pass, and stack that is used.

   With one instruction a nanosecond (qemu -icount shift=0) and a clock of 25 MHz the board's timer counts one in 40 of
   them. The stack is painted, and what is no longer painted has been used. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

#define TIMER_CONTROL (*(volatile uint32_t *)0x40000000)
#define TIMER (*(volatile uint32_t *)0x40000004)
#define TIMER_TOP (*(volatile uint32_t *)0x40000008)
#define INSTRUCTIONS_A_TICK 40
#define WORDS 32768 /* of stack that are painted */
#define PAINT 0xC0FFEE11u

extern uint32_t stack_top[];

static inline void start_timer(void)
{
    TIMER_TOP = TIMER = 0xFFFFFFFFu;
    TIMER_CONTROL = 1;
}

/* Instructions since a reading of the timer. */
static inline double instructions_since(uint32_t before)
{
    return (double)(uint32_t)(before - TIMER) * INSTRUCTIONS_A_TICK;
}

static inline void paint_stack(void)
{
    uint32_t *here;
    __asm volatile("mov %0, sp" : "=r"(here));
    for (uint32_t *word = stack_top - WORDS; word < here; word++) *word = PAINT;
}

/* Bytes of the stack that have been used since. */
static inline unsigned long stack_used(void)
{
    uint32_t *word = stack_top - WORDS;
    while (*word == PAINT) word++;
    return (unsigned long)((uintptr_t)stack_top - (uintptr_t)word);
}

#endif
