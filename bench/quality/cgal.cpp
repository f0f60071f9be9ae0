// IN OUT hierarchy COUNT VARIATION: indices of the points that stay, int32.
// IN OUT wlop COUNT ITERATIONS: new positions. Positions, also of IN, are three doubles each.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/hierarchy_simplify_point_set.h>
#include <CGAL/property_map.h>
#include <CGAL/wlop_simplify_and_regularize_point_set.h>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

using Kernel = CGAL::Simple_cartesian<double>;
using Point = Kernel::Point_3;
using Indexed = std::pair<Point, int>;

std::vector<Point> read(const char* path) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    std::vector<double> values(file.tellg() / sizeof(double));
    file.seekg(0);
    file.read(reinterpret_cast<char*>(values.data()), values.size() * sizeof(double));
    std::vector<Point> points;
    for (size_t i = 0; i + 2 < values.size(); i += 3)
        points.emplace_back(values[i], values[i + 1], values[i + 2]);
    return points;
}

// Clusters of at most `size` points, or of less variation.
std::vector<Indexed> clustered(const std::vector<Point>& points, unsigned size, double variation) {
    std::vector<Indexed> kept;
    for (size_t i = 0; i < points.size(); ++i) kept.emplace_back(points[i], static_cast<int>(i));
    const auto settings = CGAL::parameters::size(size).maximum_variation(variation)
        .point_map(CGAL::First_of_pair_property_map<Indexed>());
    kept.erase(CGAL::hierarchy_simplify_point_set(kept, settings), kept.end());
    return kept;
}

// The size of clusters by bisection, as near to `count` as eleven tries come.
std::vector<Indexed> hierarchy(const std::vector<Point>& points, long count, double variation) {
    std::vector<Indexed> best;
    double low = 1, high = 80.0 * points.size() / count;
    for (int i = 0; i < 11 && high / low >= 1.002; ++i) {
        const auto size = static_cast<unsigned>(std::max(1.0, std::sqrt(low * high)));
        auto kept = clustered(points, size, variation);
        const long off = static_cast<long>(kept.size()) - count;
        const long best_off = static_cast<long>(best.size()) - count;
        if (best.empty() || std::labs(off) < std::labs(best_off)) best = kept;
        if (std::labs(off) < 0.005 * count) break;
        (off > 0 ? low : high) = size;
    }
    return best;
}

int main(int, char** arguments) {
    auto points = read(arguments[1]);  // WLOP sorts them
    std::ofstream out(arguments[2], std::ios::binary);
    const long count = std::atol(arguments[4]);
    if (std::string(arguments[3]) == "hierarchy") {
        for (const auto& kept : hierarchy(points, count, std::atof(arguments[5])))
            out.write(reinterpret_cast<const char*>(&kept.second), 4);
        return 0;
    }
    std::vector<Point> moved;
    const auto settings = CGAL::parameters::select_percentage(100.0 * count / points.size())
        .number_of_iterations(std::atoi(arguments[5]));
    CGAL::wlop_simplify_and_regularize_point_set<CGAL::Parallel_if_available_tag>(
        points, std::back_inserter(moved), settings);
    for (const auto& p : moved) {
        const double position[] = {p.x(), p.y(), p.z()};
        out.write(reinterpret_cast<const char*>(position), sizeof position);
    }
}
