/* Cyclone DDS's own CDR reader and writer behind two functions: its headers are C. */
#ifndef ADIT_TESTS_WIRE_IDLC_ENCODER_H
#define ADIT_TESTS_WIRE_IDLC_ENCODER_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Reads little-endian CDR without encapsulation into idlc's C struct of `type` ("sensor_msgs_msg_Image") and writes it
   again in both byte orders. The caller frees both buffers, of `*out_size` bytes each. 0: unknown type. */
int idlc_reencode(const char* type, const void* cdr, size_t size, unsigned char** little, unsigned char** big,
                  size_t* out_size);

#ifdef __cplusplus
}
#endif

#endif
