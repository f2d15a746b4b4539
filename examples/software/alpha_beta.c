/* An alpha-beta filter that speaks hmpim's line protocol, in C99 and nothing else.

     cc -std=c99 -o alpha_beta alpha_beta.c
     hmpim run --rig process:./alpha_beta s.csv -o r.h5                                      */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int main(void) {
  char line[256];
  double rate = 0.0, x = 0.0, v = 0.0;
  if (!fgets(line, sizeof line, stdin) || sscanf(line, "hmpim 1 rate=%lf", &rate) != 1) {
    puts("error this program speaks hmpim 1");
    return 1;
  }
  puts("ready");
  fflush(stdout); /* after each line, or hmpim waits for ever */
  while (fgets(line, sizeof line, stdin) && strncmp(line, "end", 3) != 0) {
    double u = strtod(line, NULL), T = 1.0 / rate;
    double ahead = x + T * v, gap = u - ahead;
    x = ahead + 0.5 * gap;
    v += 0.1 / T * gap;
    printf("%.17g\n", x);
    fflush(stdout);
  }
  return 0;
}
