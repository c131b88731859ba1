// A block that slides from an incline through an arc of a circle onto level ground without friction: v = sqrt(2 g h), h
// the fall of its centre of mass, about 1 m (matter, AnalyticSlipFree, 1e-3). The track is a mesh.
#pragma once

#include "validation/case.h"

namespace graupel::validation {

Outcome curved_track(const RunOptions& options);

}  // namespace graupel::validation
