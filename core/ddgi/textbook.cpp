// SPDX-License-Identifier: Apache-2.0
#include "ddgi/textbook.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "shared/atlas_format.h"

namespace probelab {
namespace {

constexpr uint32_t kQueryGroup = 64;
constexpr std::size_t kMaxPoints = std::size_t{1} << 20;
static_assert(sizeof(QueryPoint) == 36);  // Point in query.comp.glsl

// Bytes of shared memory a ray needs: its direction, and radiance with distance or the distance.
uint32_t sharedBytesPerRay(bool is_irradiance) { return is_irradiance ? 28 : 16; }

}  // namespace

TextbookField::TextbookField(GpuContext& context, const Lattice& lattice,
                             const TextbookSettings& settings)
    : context_(context), lattice_(lattice), settings_(settings), commands_(context, 3) {
  PROBELAB_CHECK(settings.rays > 0 && lattice.pointCount() > 0);
  PROBELAB_CHECK(settings.irradiance_texels > 2 && settings.moment_texels > 2);
  irradiance_ = makeAtlas(true);
  moments_ = makeAtlas(false);
  query_ =
      createPipeline(context_,
                     {"textbook/query.comp.glsl",
                      {{"PL_IRRADIANCE_TEXELS", std::to_string(settings.irradiance_texels) + ".0"},
                       {"PL_MOMENT_TEXELS", std::to_string(settings.moment_texels) + ".0"}},
                      {}},
                     {2, false, sizeof(TextbookQuery), 0, 2});
}

TextbookField::Atlas TextbookField::makeAtlas(bool is_irradiance) {
  const uint32_t side = is_irradiance ? settings_.irradiance_texels : settings_.moment_texels;
  const auto width = side * static_cast<uint32_t>(lattice_.count.x);
  const auto height = side * static_cast<uint32_t>(lattice_.count.z);
  const ImageSize size{width, height, static_cast<uint32_t>(lattice_.count.y)};
  const ImageFormat format =
      is_irradiance ? (settings_.full_floats ? ImageFormat::rgba32f : ImageFormat::rgba16f)
                    : (settings_.full_floats ? ImageFormat::rg32f : ImageFormat::rg16f);
  const bool fits =
      settings_.rays * sharedBytesPerRay(is_irradiance) <= context_.info().max_shared_memory_bytes;
  Atlas atlas;
  atlas.image = createImage(context_, format, size,
                            is_irradiance ? "textbook irradiance" : "textbook moments");
  atlas.blend = createPipeline(context_,
                               {"textbook/blend.comp.glsl",
                                {{"PL_BLEND", is_irradiance ? "0" : "1"},
                                 {"PL_TEXELS", std::to_string(side)},
                                 {"PL_RAYS", std::to_string(settings_.rays)},
                                 {"PL_FORMAT", glslName(format)},
                                 {"PL_SHARED_MEMORY", settings_.shared_memory && fits ? "1" : "0"}},
                                {}},
                               {2, false, sizeof(TextbookBlend), 1, 0});
  return atlas;
}

void TextbookField::setRays(std::span<const Vec3f> directions, std::span<const Vec4f> rays) {
  PROBELAB_CHECK_EQ(directions.size(), settings_.rays);
  PROBELAB_CHECK_EQ(rays.size(), std::size_t{probeCount()} * settings_.rays);
  std::vector<Vec4f> padded;
  for (const Vec3f& d : directions) padded.emplace_back(d.x, d.y, d.z, 0.0f);
  directions_ = createBufferFrom(context_, padded, MemoryUse::device, "textbook directions");
  const DeviceInfo& device = context_.info();
  const uint64_t probe_bytes = uint64_t{settings_.rays} * sizeof(Vec4f);
  const auto capacity = static_cast<uint32_t>(std::min<uint64_t>(
      device.max_storage_buffer_range / probe_bytes, device.max_workgroup_count[0]));
  PROBELAB_CHECK(capacity > 0);
  batches_.clear();
  for (uint32_t first = 0; first < probeCount(); first += capacity) {
    const uint32_t count = std::min(capacity, probeCount() - first);
    const auto part =
        rays.subspan(std::size_t{first} * settings_.rays, std::size_t{count} * settings_.rays);
    batches_.push_back(
        {first, count, createBufferFrom(context_, part, MemoryUse::device, "textbook rays")});
  }
}

// The thresholds act on half the mean in the SDK, hence the factor on the stored root.
TextbookBlend TextbookField::blendConstants() const {
  const float scale = std::exp2(1 / settings_.encoding_gamma);
  TextbookBlend push{};
  push.count_x = static_cast<uint32_t>(lattice_.count.x);
  push.count_y = static_cast<uint32_t>(lattice_.count.y);
  push.hysteresis = settings_.hysteresis;
  push.encode_exponent = 1 / settings_.encoding_gamma;
  push.irradiance_threshold = settings_.irradiance_threshold * scale;
  push.brightness_threshold = settings_.brightness_threshold * scale;
  push.smallest_step = scale / 1024;
  push.backface_limit =
      static_cast<uint32_t>(static_cast<float>(settings_.rays) * settings_.backface_share);
  push.distance_exponent = settings_.distance_exponent;
  push.largest_distance = 1.5f * length(lattice_.spacing);
  return push;
}

void TextbookField::recordBlend(const Atlas& atlas) {
  TextbookBlend push = blendConstants();
  for (const Batch& batch : batches_) {
    push.first_probe = batch.first_probe;
    commands_.dispatch(atlas.blend,
                       Bindings{{&directions_, &batch.rays}, nullptr, {&atlas.image}, {}},
                       pushBytes(push), batch.probe_count);
  }
  commands_.barrier();
}

std::vector<TextbookBlendTime> TextbookField::timeBlend(int repeats, int warm_up) {
  PROBELAB_CHECK(!batches_.empty());
  std::vector<TextbookBlendTime> times;
  for (int i = -warm_up; i < repeats; ++i) {
    commands_.begin();
    commands_.timestamp("start");
    recordBlend(irradiance_);
    commands_.timestamp("irradiance");
    recordBlend(moments_);
    commands_.timestamp("moments");
    commands_.submitAndWait();
    const auto stamps = commands_.timestampsMs();
    if (i >= 0) times.push_back({stamps[1].second, stamps[2].second - stamps[1].second});
  }
  return times;
}

// Calls body(dispatch, results) with the images in use by the sampler: dispatch() runs the query
// once and returns its milliseconds.
template <class Body>
void TextbookField::withQuery(std::span<const QueryPoint> points, const Body& body) {
  PROBELAB_CHECK(!points.empty() && points.size() <= kMaxPoints);
  const GpuBuffer in = createBufferFrom(context_, points, MemoryUse::device, "textbook points");
  const GpuBuffer out =
      createBuffer(context_, points.size() * sizeof(Vec4f), MemoryUse::device, "textbook results");
  TextbookQuery push{};
  push.first = lattice_.first;
  push.spacing = lattice_.spacing;
  push.count_x = static_cast<uint32_t>(lattice_.count.x);
  push.count_y = static_cast<uint32_t>(lattice_.count.y);
  push.count_z = static_cast<uint32_t>(lattice_.count.z);
  push.point_count = static_cast<uint32_t>(points.size());
  push.normal_bias = settings_.normal_bias_m;
  push.view_bias = settings_.view_bias_m;
  push.decode_exponent = 0.5f * settings_.encoding_gamma;
  const auto run = [&] {
    commands_.begin();
    for (Atlas* atlas : {&irradiance_, &moments_})
      commands_.setUse(atlas->image, ImageUse::sampled);
    commands_.timestamp("start");
    commands_.dispatch(query_,
                       Bindings{{&in, &out}, nullptr, {}, {&irradiance_.image, &moments_.image}},
                       pushBytes(push), groupCount(points.size(), kQueryGroup));
    commands_.timestamp("query");
    for (Atlas* atlas : {&irradiance_, &moments_})
      commands_.setUse(atlas->image, ImageUse::storage);
    commands_.submitAndWait();
    return commands_.timestampsMs()[1].second;
  };
  body(run, out);
}

std::vector<Vec3f> TextbookField::query(std::span<const QueryPoint> points) {
  std::vector<Vec3f> irradiance;
  withQuery(points, [&](const auto& run, const GpuBuffer& results) {
    run();
    for (const Vec4f& e : downloadArray<Vec4f>(context_, results))
      irradiance.emplace_back(e.x, e.y, e.z);
  });
  return irradiance;
}

std::vector<double> TextbookField::timeQuery(std::span<const QueryPoint> points, int repeats) {
  std::vector<double> times;
  withQuery(points, [&](const auto& run, const GpuBuffer&) {
    run();
    for (int i = 0; i < repeats; ++i) times.push_back(run());
  });
  return times;
}

// The words of all texels, reordered from slices to [probe][texel_y][texel_x].
std::vector<uint32_t> TextbookField::texelWords(GpuImage& image, uint32_t side) {
  std::vector<uint32_t> slices(image.bytes() / sizeof(uint32_t)), words(slices.size());
  download(context_, image, std::as_writable_bytes(std::span<uint32_t>(slices)));
  const ImageSize size = image.size();
  const std::size_t texel_words = texelBytes(image.format()) / sizeof(uint32_t);
  const std::size_t row_words = side * texel_words;
  const auto nx = static_cast<std::size_t>(lattice_.count.x);
  const auto ny = static_cast<std::size_t>(lattice_.count.y);
  for (std::size_t probe = 0; probe < probeCount(); ++probe)
    for (std::size_t y = 0; y < side; ++y) {
      const std::size_t row = probe / nx % ny * size.height + probe / (nx * ny) * side + y;
      const std::size_t from = (row * size.width + probe % nx * side) * texel_words;
      std::copy_n(slices.begin() + static_cast<std::ptrdiff_t>(from), row_words,
                  words.begin() + static_cast<std::ptrdiff_t>((probe * side + y) * row_words));
    }
  return words;
}

std::vector<Vec3f> TextbookField::irradianceTexels() {
  const std::vector<uint32_t> words = texelWords(irradiance_.image, settings_.irradiance_texels);
  std::vector<Vec3f> texels;
  for (std::size_t i = 0; i < words.size(); i += settings_.full_floats ? 4 : 2)
    texels.emplace_back(channel(&words[i], 0), channel(&words[i], 1), channel(&words[i], 2));
  return texels;
}

std::vector<Vec2f> TextbookField::momentTexels() {
  const std::vector<uint32_t> words = texelWords(moments_.image, settings_.moment_texels);
  std::vector<Vec2f> texels;
  for (std::size_t i = 0; i < words.size(); i += settings_.full_floats ? 2 : 1)
    texels.emplace_back(channel(&words[i], 0), channel(&words[i], 1));
  return texels;
}

float TextbookField::channel(const uint32_t* texel, uint32_t index) const {
  if (settings_.full_floats) return uintBitsToFloat(texel[index]);
  return unpackHalfFloat(texel[index / 2] >> (16 * (index % 2)) & 0xffffu);
}

}  // namespace probelab
