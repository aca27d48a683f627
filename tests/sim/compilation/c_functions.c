/* C functions of the shapes that libraries of vendors have. */
#include <stdint.h>

typedef struct { unsigned code; int inner; unsigned device; } Info;

static double kept[3];

int total(signed char a, unsigned char b, double c, unsigned d, const double *e, int64_t f) { return a + b + (int)c + (int)d + (int)*e + (int)f; }
void keep(double x, double y, double z, char scale) { kept[0] = scale * x; kept[1] = scale * y; kept[2] = scale * z; }
double *kept_numbers(void) { return kept; }
Info give(void) { Info info = {0xC0DEu, -2, 3u}; return info; }
Info *give_hidden(Info *room) { *room = give(); return room; }
unsigned ask(unsigned (*callback)(void *), void *data) { return callback(data); }
