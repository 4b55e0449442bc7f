/* Start-up of a Cortex-M7 for the tests: floating-point unit, memory, C library, main. Output goes to the emulator by
   semihosting, and so does the exit code. */
#include <stdint.h>
#include <stdlib.h>

#define CPACR (*(volatile uint32_t *)0xE000ED88) /* access to the coprocessors */
#define SYS_EXIT_EXTENDED 0x20
#define STOPPED_BY_FAULT 0x20023

/* from the linker script */
extern uint32_t data_from[], data_begin[], data_end[], bss_begin[], bss_end[], stack_top[];

int main(void);
void initialise_monitor_handles(void); /* newlib's side of semihosting */
void __libc_init_array(void);

static void fault(void)
{
    static const uint32_t reason[2] = {STOPPED_BY_FAULT, 1};
    register uint32_t call __asm("r0") = SYS_EXIT_EXTENDED;
    register const uint32_t *with __asm("r1") = reason;
    __asm volatile("bkpt 0xab" : : "r"(call), "r"(with) : "memory");
    for (;;) {
    }
}

void reset(void)
{
    CPACR |= 0xFu << 20;
    __asm volatile("dsb\n isb");
    for (uint32_t *to = data_begin, *from = data_from; to < data_end;) *to++ = *from++;
    for (uint32_t *to = bss_begin; to < bss_end;) *to++ = 0;
    initialise_monitor_handles();
    __libc_init_array();
    exit(main());
}

typedef void (*handler)(void);
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    handler handlers[15];
} vectors = {stack_top, {reset, fault, fault, fault, fault, fault}};

/* called by newlib around main, where a hosted program has constructors */
void _init(void) {}
void _fini(void) {}
