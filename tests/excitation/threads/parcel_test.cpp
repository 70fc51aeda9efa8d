#include "excitation/threads/parcel.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/process/thread_team.hpp"

namespace stageid::test_parcel {

struct Item {
  int number = 0;
  std::string text;
  Eigen::MatrixXcd matrix;
};

void carry(Parcel& parcel, Item& item) {
  parcel(item.number), parcel(item.text), parcel(item.matrix);
}

std::vector<Item> items() {
  return {{1, "one", Eigen::MatrixXcd::Constant(2, 3, {1.0, -2.0})}, {2, "", {}}, {3, "three", {}}};
}

TEST(Parcel, EveryProcessGetsTheValuesOfTheOwner) {
  for (const int size : {1, 2, 3})
    test::run_team(size, [&](const Team& team) {
      for (int owner = 0; owner < size; ++owner) {
        std::vector<Item> values = team.rank() == owner ? items() : std::vector<Item>(7);
        broadcast(team, owner, values);
        ASSERT_EQ(values.size(), items().size());
        for (std::size_t i = 0; i < values.size(); ++i) {
          EXPECT_EQ(values[i].number, items()[i].number);
          EXPECT_EQ(values[i].text, items()[i].text);
          EXPECT_EQ(values[i].matrix, items()[i].matrix);
        }
      }
    });
}

}  // namespace stageid::test_parcel
