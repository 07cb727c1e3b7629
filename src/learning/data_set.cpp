#include "tunnel_pilot/learning/data_set.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace tunnel_pilot::learning {

void append(DataSet& to, DataSet other) {
  std::uint32_t first_free = 0;
  for (const Example& example : to) first_free = std::max(first_free, example.tunnel + 1);
  for (Example& example : other) example.tunnel += first_free;
  to.insert(to.end(), std::make_move_iterator(other.begin()), std::make_move_iterator(other.end()));
}

}  // namespace tunnel_pilot::learning
