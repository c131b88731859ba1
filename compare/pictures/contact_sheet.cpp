#include "compare/pictures/contact_sheet.h"

#include <algorithm>
#include <numeric>

#include "compare/pictures/bitmap_font.h"
#include "compare/pictures/raster.h"

namespace graupel::compare {

namespace {

constexpr int gap = 4;  ///< between pictures [pixels]
constexpr Color gap_color = {24, 26, 30};

double mean_volume(const ParticleRun& run) {
  return std::accumulate(run.volume.begin(), run.volume.end(), 0.0) /
         static_cast<double>(std::max<std::size_t>(1, run.size()));
}

/// The particles that are in the run in a frame.
Image picture_of(const Backdrop& backdrop, const ParticleRun& run, std::size_t frame, double radius) {
  std::vector<Vec3f> position;
  std::vector<int32_t> type;
  for (std::size_t i = 0; i < run.size(); ++i) {
    if (!run.is_active(frame, i)) continue;
    position.push_back(run.position(frame)[i]);
    type.push_back(run.trajectory.particle_type[i]);
  }
  return draw_particles(backdrop, position, type, radius);
}

}  // namespace

std::vector<std::size_t> picture_frames(std::size_t last) {
  if (last >= 300) return {10, 60, 150, 300};
  std::vector<std::size_t> frames;
  for (std::size_t quarter = 1; quarter <= 4; ++quarter) {
    const std::size_t frame = std::max<std::size_t>(1, (quarter * last + 2) / 4);
    if (frame <= last && (frames.empty() || frame > frames.back())) frames.push_back(frame);
  }
  return frames;
}

Image picture_row(const Backdrop& backdrop, const ParticleRun& run, const std::vector<std::size_t>& frames,
                  const std::string& label) {
  const int width = backdrop.camera.width / supersampling, height = backdrop.camera.height / supersampling;
  const int count = static_cast<int>(frames.size());
  Image row(count * width + (count - 1) * gap, height, gap_color);
  const double radius = sphere_radius(mean_volume(run));
  for (int k = 0; k < count; ++k) {
    const std::size_t frame = frames[static_cast<std::size_t>(k)];
    Image picture = picture_of(backdrop, run, frame, radius);
    draw_text(picture, 6, 6, label, {235, 238, 242}, height >= 240 ? 2 : 1);
    const std::string number = "frame " + std::to_string(frame);
    draw_text(picture, width - text_width(number) - 6, height - 13, number, {235, 238, 242});
    paste(row, picture, k * (width + gap), 0);
  }
  return row;
}

Image stack_rows(const std::vector<Image>& rows) {
  if (rows.empty()) return {};
  int height = -gap;
  for (const Image& row : rows) height += row.height + gap;
  Image sheet(rows.front().width, height, gap_color);
  int y = 0;
  for (const Image& row : rows) {
    paste(sheet, row, 0, y);
    y += row.height + gap;
  }
  return sheet;
}

}  // namespace graupel::compare
