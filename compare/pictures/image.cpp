#include "compare/pictures/image.h"

namespace graupel::compare {

void paste(Image& target, const Image& source, int x, int y) {
  for (int j = 0; j < source.height; ++j)
    for (int i = 0; i < source.width; ++i)
      if (target.contains(x + i, y + j)) target.set(x + i, y + j, source.at(i, j));
}

}  // namespace graupel::compare
