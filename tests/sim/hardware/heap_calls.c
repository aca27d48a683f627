/* Counts heap allocations of each thread between heap_open() and heap_close(); preloaded before glibc, whose functions
 * it calls. */
#include <stddef.h>

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

static __thread long open;
static long calls;

static void count_call(void) { if (open) __sync_fetch_and_add(&calls, 1); }

void *malloc(size_t size) { count_call(); return __libc_malloc(size); }
void *calloc(size_t count, size_t size) { count_call(); return __libc_calloc(count, size); }
void *realloc(void *old, size_t size) { count_call(); return __libc_realloc(old, size); }
void *memalign(size_t edge, size_t size) { count_call(); return __libc_memalign(edge, size); }
void *aligned_alloc(size_t edge, size_t size) { return memalign(edge, size); }
int posix_memalign(void **at, size_t edge, size_t size) { return (*at = memalign(edge, size)) ? 0 : 12; }

void heap_open(void) { open = 1; }
void heap_close(void) { open = 0; }
long heap_calls(void) { return calls; }
