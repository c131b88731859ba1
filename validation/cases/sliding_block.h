// A block on rigid surfaces: on an inclined plane x = g t^2/2 (sin th - mu cos th), or at rest where mu >= tan th
// (matter: th 24 degrees, mu tan 15, 5 s, 19.859 m); on a plane that moves away below it, and on a turning table.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome sliding_block(const RunOptions& options);
Outcome moving_plane(const RunOptions& options);
Outcome turntable(const RunOptions& options);

}  // namespace graupel::validation
