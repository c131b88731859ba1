// Forces on obstacles and walls as CSV.
#include <charconv>

#include "core/system/atomic_file.h"
#include "io/export/export.h"

namespace graupel::io {

namespace {

/// The shortest text that reads back as the same number.
std::string text_of(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

}  // namespace

void export_forces(const ForceTable& table, const std::string& file) {
  std::string text = "frame,time_s,name";
  for (const char* column : {"impulse_?_N_s", "force_?_N", "torque_?_N_m", "reference_?_m"})
    for (const char axis : {'x', 'y', 'z'}) {
      std::string name = column;
      name[name.find('?')] = axis;
      text += ',';
      text += name;
    }
  text += "\n";
  const auto add = [&text](const std::string& value) {
    text += ',';
    text += value;
  };
  for (std::size_t frame = 0; frame < table.forces.size(); ++frame)
    for (std::size_t i = 0; i < table.names.size(); ++i) {
      const ContactForce& on = table.forces[frame][i];
      text += std::to_string(frame);
      add(text_of(table.times[frame]));
      add(table.names[i]);
      for (const Vec3d& v : {on.impulse, on.force, on.torque, on.reference})
        for (int d = 0; d < 3; ++d) add(text_of(v[d]));
      text += "\n";
    }
  write_file_atomically(file, text);
}

}  // namespace graupel::io
