#ifdef EACH_SAMPLE
// Lids hide parts of a pixel: what they leave is shaded, not the whole of it.
#define EACH sample
const float ACROSS = 0.5;  // a sample stands for half a pixel in either direction
#else
#define EACH
const float ACROSS = 1.0;
#endif
