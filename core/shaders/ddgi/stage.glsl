// SPDX-License-Identifier: Apache-2.0
// What every stage starts with. One invocation an item, in workgroups of 64 along x.
//
// Data that every invocation reads at a place of its own comes through references (64-bit addresses
// in the push constants): a software device gathers them three times as fast as a bound buffer,
// a GPU does not mind. What all invocations read alike stays in bound buffers (uniform ones where
// it is small), and is read before the flow diverges: a software device then reads it once.
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_control_flow_attributes : require

#define BUFFER(index, access, name, declaration) \
  layout(set = 0, binding = index, scalar) access buffer name { declaration; }
#define UNIFORM(index, name, declaration) \
  layout(set = 0, binding = index, scalar) uniform name { declaration; }
#define REFERENCE(access, name, type) \
  layout(buffer_reference, scalar, buffer_reference_align = 4) access buffer name { type at[]; }

const uint kGroupSize = 64u;
layout(local_size_x = 64) in;
