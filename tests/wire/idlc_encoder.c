#include "tests/wire/idlc_encoder.h"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_cdrstream.h>
#include <dds/ddsi/ddsi_serdata_default.h>
#include <stdlib.h>
#include <string.h>

#include "encoder_types.h"

static const dds_topic_descriptor_t* const descriptors[] = {
    &std_msgs_msg_Empty_desc,
    &sensor_msgs_msg_PointCloud2_desc,
    &sensor_msgs_msg_Image_desc,
    &sensor_msgs_msg_CameraInfo_desc,
    &sensor_msgs_msg_Imu_desc,
    &sensor_msgs_msg_LaserScan_desc,
    &sensor_msgs_msg_JointState_desc,
    &nav_msgs_msg_Odometry_desc,
    &nav_msgs_msg_Path_desc,
    &tf2_msgs_msg_TFMessage_desc,
    &rcl_interfaces_msg_Log_desc,
    &diagnostic_msgs_msg_DiagnosticArray_desc,
    &adit_msgs_msg_ThermalFrame_desc,
    &rcl_interfaces_msg_ParameterEvent_desc,
    &adit_msgs_msg_Localizability_desc,
    &adit_msgs_msg_FusionStatus_desc,
};

static unsigned char* copy(const dds_ostream_t* stream) {
  unsigned char* out = malloc(stream->m_index + 1);
  memcpy(out, stream->m_buffer, stream->m_index);
  return out;
}

int idlc_reencode(const char* type, const void* cdr, size_t size, unsigned char** little, unsigned char** big,
                  size_t* out_size) {
  const dds_topic_descriptor_t* descriptor = 0;
  for (size_t i = 0; i < sizeof descriptors / sizeof *descriptors; ++i) {
    if (strcmp(descriptors[i]->m_typename, type) == 0) descriptor = descriptors[i];
  }
  if (!descriptor) return 0;
  struct ddsi_sertype_default sertype;
  memset(&sertype, 0, sizeof sertype);
  sertype.type.size = descriptor->m_size;
  sertype.type.align = descriptor->m_align;
  sertype.type.flagset = descriptor->m_flagset;
  sertype.type.ops.nops = descriptor->m_nops;
  sertype.type.ops.ops = (uint32_t*)descriptor->m_ops;

  void* sample = calloc(1, descriptor->m_size);
  dds_istream_t in;
  dds_istream_init(&in, (uint32_t)size, cdr, CDR_ENC_VERSION_1);
  dds_stream_read_sample(&in, sample, &sertype);

  dds_ostreamLE_t le;
  dds_ostreamLE_init(&le, 0, CDR_ENC_VERSION_1);
  dds_stream_writeLE(&le, sample, descriptor->m_ops);
  dds_ostreamBE_t be;
  dds_ostreamBE_init(&be, 0, CDR_ENC_VERSION_1);
  dds_stream_writeBE(&be, sample, descriptor->m_ops);
  *out_size = le.x.m_index;
  *little = copy(&le.x);
  *big = copy(&be.x);
  dds_ostreamLE_fini(&le);
  dds_ostreamBE_fini(&be);
  dds_stream_free_sample(sample, descriptor->m_ops);
  free(sample);
  return 1;
}
